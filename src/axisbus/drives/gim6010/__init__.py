"""Drive plug-in of the GIM6010-8 joint module."""
