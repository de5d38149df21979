"""The page in the browser: one more program at a machine, which shows it and commands it, and never becomes part of its cycle."""
