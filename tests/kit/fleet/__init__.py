"""Cells of a plant for tests: programs on a Zenoh network of this computer that imitate the messages of a bridge."""
