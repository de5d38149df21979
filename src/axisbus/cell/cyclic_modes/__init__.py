"""The needs of an axis's cyclic modes in its PDOs: offsets of feed-forward, and the target of ip."""
