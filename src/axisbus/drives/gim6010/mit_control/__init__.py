"""MIT control of one module, from the first heartbeat to ESTOP; pure functions of frames and time."""
