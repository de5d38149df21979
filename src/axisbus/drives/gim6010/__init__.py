"""The GIM6010-8 joint module."""
