"""Cells of a plant for tests: stand-ins on a Zenoh network of this computer, which play what a bridge tells."""
