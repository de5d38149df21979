"""``axisbus sim``: simulated drives of a cell, in a process of their own."""
