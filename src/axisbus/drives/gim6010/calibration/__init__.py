"""Calibration of a module's motor and encoder: its effect, its supervision and its result; without input or output."""
