"""cell.toml as frozen values, with the line of each value."""
