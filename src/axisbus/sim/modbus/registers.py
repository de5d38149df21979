"""The registers of a module as the manual prints them (4.3.2, 4.3.3), typed off for the stand-in: address, type, parameter.

Addresses of several registers are those of the first; the type's letter is struct's, highest byte first.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Act(IntEnum):
    """Holding registers where any value does something."""

    EMERGENCY_STOP = 0x61
    REBOOT = 0x7E
    CLEAR_ERRORS = 0x7F
    SAVE = 0x80


class Place(NamedTuple):
    """One value: struct's letter, and the path of the parameter in the USB tree that it is; empty where it is none."""

    kind: str
    path: str


STATE, FLAGS, RETURN = 0x01, 0x02, 0x31
NODE_ID, STATE_CONTROL = 0x62, 0x63
ENDPOINT, ENDPOINT_VALUE = 0xA1, 0xA2
POSITION, VELOCITY = 0x0F, 0x11
POSITION_TARGET = 0x66
STATES = (1, 3, 4, 7, 8, 11)
_CONTROLLER, _CONFIG = "axis0.controller.", "axis0.controller.config."
_TRAJECTORY = "axis0.traj_traj.config."

INPUTS = {
    STATE: Place("H", "axis0.current_state"),
    FLAGS: Place("H", ""),
    0x03: Place("I", "axis0.error"),
    0x05: Place("Q", "axis0.motor.error"),
    0x09: Place("I", "axis0.encoder.error"),
    0x0B: Place("I", "axis0.controller.error"),
    0x0D: Place("I", "error"),
    POSITION: Place("f", "axis0.encoder.pos_estimate"),
    VELOCITY: Place("f", "axis0.encoder.vel_estimate"),
    0x13: Place("f", "vbus_voltage"),
    0x15: Place("f", "ibus"),
    0x17: Place("f", ""),
    0x19: Place("f", ""),
    RETURN: Place("I", ""),
}
HOLDINGS = {
    **{int(act): Place("H", "") for act in Act},
    NODE_ID: Place("H", "axis0.config.can.node_id"),
    STATE_CONTROL: Place("H", "axis0.requested_state"),
    0x64: Place("H", _CONFIG + "control_mode"),
    0x65: Place("H", _CONFIG + "input_mode"),
    POSITION_TARGET: Place("f", _CONTROLLER + "input_pos"),
    0x68: Place("f", _CONTROLLER + "input_vel"),
    0x6A: Place("f", _CONTROLLER + "input_torque"),
    0x6C: Place("f", _CONFIG + "vel_limit"),
    0x6E: Place("f", "axis0.motor.config.current_lim"),
    0x70: Place("f", _TRAJECTORY + "vel_limit"),
    0x72: Place("f", _TRAJECTORY + "accel_limit"),
    0x74: Place("f", _TRAJECTORY + "decel_limit"),
    0x76: Place("f", _CONFIG + "inertia"),
    0x78: Place("f", _CONFIG + "pos_gain"),
    0x7A: Place("f", _CONFIG + "vel_gain"),
    0x7C: Place("f", _CONFIG + "vel_integrator_gain"),
    ENDPOINT: Place("H", ""),
    ENDPOINT_VALUE: Place("I", ""),
}
