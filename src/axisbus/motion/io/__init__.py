"""Named inputs and outputs in the cycle: commanded values, known values, and the change to the safe state."""
