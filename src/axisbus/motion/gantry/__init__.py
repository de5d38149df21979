"""Gantry pairs: two axes that carry one beam, driven as one, with the skew between them watched."""
