"""The simulated drive: a motor and the behaviour of a CiA 402 drive by time step, run directly or as a node on a bus."""
