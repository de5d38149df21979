"""``axisbus monitor``: observe the axes of a machine, or the traffic of a bus."""
