"""Kinematics of a program's own: called in the program alone, and sampled before anything moves."""
