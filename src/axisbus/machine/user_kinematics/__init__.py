"""The user's own kinematics: called only in the program, and sampled before anything moves."""
