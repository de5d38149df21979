"""Leading one module by MIT control, from the first look to its way out; pure functions of frames and time."""
