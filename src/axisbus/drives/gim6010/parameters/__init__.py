"""The parameters of a module by name, whatever brings them: what may be written, backups, and what differs."""
