"""The stand-in drive: a motor and a CiA 402 drive's behaviour by time step, run directly or as a node on a bus."""
