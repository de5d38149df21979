"""Shared code of the tests of motion: an axis with its drive in virtual time, steps of its parts, and a look at its plant."""
