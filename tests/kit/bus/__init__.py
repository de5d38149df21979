"""What the tests of the bus share: a fake bus with peers on it, plans of PDOs, ports and a small master."""
