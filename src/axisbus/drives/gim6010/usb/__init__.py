"""A module on its USB port: the tree of its parameters, which it describes itself."""
