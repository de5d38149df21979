"""What a commissioning sets in a module: which parameters, in which order, what stands against it, and what is to be said of it."""
