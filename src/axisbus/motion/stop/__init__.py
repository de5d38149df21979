"""Everything that stops an axis or looks whether it stands."""
