"""A node brought up, or the reason why not."""
