"""What the cyclic modes of an axis need of its PDOs: offsets of feed-forward, and the target of ip."""
