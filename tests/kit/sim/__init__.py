"""What the tests of the simulated drive share: its EDS texts, a rig around it, and a wire for SDO frames."""
