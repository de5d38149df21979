"""A module on its USB port: its object tree, which the module describes itself."""
