"""How a drive is reported once another process has stopped its axis x."""

# At standstill a drive goes from quick stop active to switch on disabled by itself (605Ah 1 to 4): the report may come before.
STOPPED = "x: (stands, held in quick stop|stopped, power is off)"
