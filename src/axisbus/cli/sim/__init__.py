"""``axisbus sim``: stand-ins for the drives of a cell, in a process of their own."""
