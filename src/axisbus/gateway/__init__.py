"""Bridges to what plants and robots have: each one more program at a machine, in a process of its own."""
