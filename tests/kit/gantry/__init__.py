"""A simulated pair of axes that carry one beam, and what its plants say of it."""
