"""What an axis can be doing: one file for each kind of motion, and what they share."""
