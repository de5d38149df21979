"""Overrides: by what the velocities of commands are multiplied, and how a move of a drive takes another one up."""
