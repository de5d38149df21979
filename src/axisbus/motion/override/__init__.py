"""Overrides: the factors for the velocities of commands, and the change of velocity in a running move of a drive."""
