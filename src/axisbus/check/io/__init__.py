"""The checks of named inputs and outputs."""
