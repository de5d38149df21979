"""MIT control of one module, from the first heartbeat to the removal of its power; pure functions of frames and time."""
