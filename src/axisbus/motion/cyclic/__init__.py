"""Cyclic velocity and torque modes: one target per cycle, on ramps computed by the master."""
