"""A simulated pair of axes that carry one beam, and observations of its plants."""
