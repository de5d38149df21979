"""Calibrating a module's motor and encoder: what it does, how it is followed, and what it came to; all of it pure."""
