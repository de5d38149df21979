"""The configuration of a node as a file: taken from the device, compared, and brought back with every object read again."""
