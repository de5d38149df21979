"""Random motion of axes that the master leads, with what it comes to as a share of what is allowed: ``make bounds``."""
