"""Limits of jerk in moves of one axis: by its drive, or led by the master."""
