"""Shared code of the tests of the simulated drive: its EDS texts, a rig around it, and a wire for SDO frames."""
