"""MIT control of one module for a program's own loop: what a user holds."""
