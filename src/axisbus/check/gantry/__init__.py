"""What is wrong with pairs of axes that carry one beam, before the first frame."""
