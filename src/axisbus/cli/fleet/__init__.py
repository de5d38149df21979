"""``axisbus fleet``: the cells of a plant, over its network."""
