"""``axisbus gim6010``: commands specific to the GIM6010-8, for all of its protocols."""
