"""``axisbus bridge``: a machine joined to what a plant has."""
