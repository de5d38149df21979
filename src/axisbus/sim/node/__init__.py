"""The stand-in as a CANopen node: SDO, PDO, NMT, LSS and heartbeat around a simulated device."""
