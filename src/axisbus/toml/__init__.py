"""Read TOML files by tables of keys: the values, and all errors with their lines."""
