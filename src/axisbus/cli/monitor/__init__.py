"""``axisbus monitor``: the axes of a machine, or what a bus tells by itself, look by look."""
