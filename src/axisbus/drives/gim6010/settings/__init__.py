"""Commissioning settings of a module: the parameters of each, their order, preconditions and remarks."""
