"""The page in the browser: a separate program at a machine, which shows and commands it, and is never part of its cycle."""
