"""``axisbus gim6010 params``: the parameters of a module, by their names over USB."""
