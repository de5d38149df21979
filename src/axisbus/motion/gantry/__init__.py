"""Gantry pairs: two axes that carry one beam and move as one, with the skew between them monitored."""
