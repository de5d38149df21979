"""``axisbus program``: show, write and verify the program of a node."""
