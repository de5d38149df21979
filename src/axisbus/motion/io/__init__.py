"""Named inputs and outputs in the cycle: what is commanded, what is known, and the way to the safe state."""
