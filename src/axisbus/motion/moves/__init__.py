"""The activities of an axis: one module for each kind of motion, and the parts that they share."""
