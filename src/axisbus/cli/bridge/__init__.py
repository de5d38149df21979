"""``axisbus bridge``: connect a machine to other systems of a plant."""
