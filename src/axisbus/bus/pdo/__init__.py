"""PDOs of one node: choose, map, configure, send and receive them."""
