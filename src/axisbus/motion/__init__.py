"""PLCopen motion: axes, commands, groups and the scan, as pure step functions."""
