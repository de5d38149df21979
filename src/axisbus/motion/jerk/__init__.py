"""Jerk limits in moves of one axis: limited by its drive, or by the master."""
