"""The simulated drive as a CANopen node: SDO, PDO, NMT, LSS and heartbeat of a simulated device."""
