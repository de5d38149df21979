"""Modes of operation of the simulated drive, one module each (velocity and torque modes in pairs)."""
