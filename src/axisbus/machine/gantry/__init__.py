"""A pair of axes that carry one beam: the public gantry."""
