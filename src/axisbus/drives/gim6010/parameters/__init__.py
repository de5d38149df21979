"""The parameters of a module by name, over any interface: write protection, backups, and differences."""
