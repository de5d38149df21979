"""One CAN channel through canopen and python-can: SDO, PDO, NMT, SYNC, heartbeat, EMCY."""
