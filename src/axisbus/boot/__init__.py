"""Boot-up of one node: its result, or the reason for its failure."""
