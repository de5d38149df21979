"""The values that an axis's cyclic modes need in its PDOs: offsets of feed-forward, and the target of ip."""
