"""CAN Simple modules on a channel with CANopen nodes: their frames in the scan's cycle, and their rescue without it."""
