"""What can be wrong with named inputs and outputs."""
