"""Simulated drives served to other programs, with planned faults, and access to their plant."""
