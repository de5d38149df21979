"""What the tests of the stand-in share: its EDS texts, a rig around it, and a wire for SDO frames."""
