"""Feed-forward: velocity and torque offsets for the drive's controllers, sent before a following error arises."""
