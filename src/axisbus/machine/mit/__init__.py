"""MIT control of one module by the user's own loop: the public objects."""
