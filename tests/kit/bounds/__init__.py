"""Random motion of axes that the master controls; its velocity, acceleration and jerk as shares of the limits: ``make bounds``."""
