"""The checks of pairs of axes that carry one beam, before the first frame is sent."""
