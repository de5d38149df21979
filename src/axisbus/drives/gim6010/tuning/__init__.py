"""Trying a module's gains: a step there and back, measured; what it does, what it came to, and what the manual has one try next."""
