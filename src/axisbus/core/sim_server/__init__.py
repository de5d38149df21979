"""Simulated drives that are served to other programs: faults that are planned for them, and a way to look at their plant."""
