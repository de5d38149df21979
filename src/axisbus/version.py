"""The version of this package, which both ends of a connection must have."""

__version__ = "0.1.0"
