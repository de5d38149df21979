"""A pair of axes that carry one beam, as its user sees it."""
