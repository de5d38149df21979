"""Shared code of the bus tests: a fake bus with peers on it, plans of PDOs, ports and a small master."""
