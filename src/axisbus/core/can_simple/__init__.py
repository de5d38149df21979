"""Modules that speak CAN Simple on a channel of CANopen nodes: their frames in the scan's cycle, and their rescue without it."""
