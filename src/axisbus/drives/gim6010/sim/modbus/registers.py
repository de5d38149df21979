"""Registers of a module as printed in the manual (4.3.2, 4.3.3), copied for the simulation: address, type, parameter.

The address of a value in several registers is that of the first; the type is struct's letter, highest byte first.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Act(IntEnum):
    """Holding registers that start an action when any value is written."""

    EMERGENCY_STOP = 0x61
    REBOOT = 0x7E
    CLEAR_ERRORS = 0x7F
    SAVE = 0x80


class RegisterAddress(NamedTuple):
    """One value: struct's letter, and the path of its parameter in the USB tree; empty if it is not a parameter."""

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
    STATE: RegisterAddress("H", "axis0.current_state"),
    FLAGS: RegisterAddress("H", ""),
    0x03: RegisterAddress("I", "axis0.error"),
    0x05: RegisterAddress("Q", "axis0.motor.error"),
    0x09: RegisterAddress("I", "axis0.encoder.error"),
    0x0B: RegisterAddress("I", "axis0.controller.error"),
    0x0D: RegisterAddress("I", "error"),
    POSITION: RegisterAddress("f", "axis0.encoder.pos_estimate"),
    VELOCITY: RegisterAddress("f", "axis0.encoder.vel_estimate"),
    0x13: RegisterAddress("f", "vbus_voltage"),
    0x15: RegisterAddress("f", "ibus"),
    0x17: RegisterAddress("f", ""),
    0x19: RegisterAddress("f", ""),
    RETURN: RegisterAddress("I", ""),
}
HOLDINGS = {
    **{int(act): RegisterAddress("H", "") for act in Act},
    NODE_ID: RegisterAddress("H", "axis0.config.can.node_id"),
    STATE_CONTROL: RegisterAddress("H", "axis0.requested_state"),
    0x64: RegisterAddress("H", _CONFIG + "control_mode"),
    0x65: RegisterAddress("H", _CONFIG + "input_mode"),
    POSITION_TARGET: RegisterAddress("f", _CONTROLLER + "input_pos"),
    0x68: RegisterAddress("f", _CONTROLLER + "input_vel"),
    0x6A: RegisterAddress("f", _CONTROLLER + "input_torque"),
    0x6C: RegisterAddress("f", _CONFIG + "vel_limit"),
    0x6E: RegisterAddress("f", "axis0.motor.config.current_lim"),
    0x70: RegisterAddress("f", _TRAJECTORY + "vel_limit"),
    0x72: RegisterAddress("f", _TRAJECTORY + "accel_limit"),
    0x74: RegisterAddress("f", _TRAJECTORY + "decel_limit"),
    0x76: RegisterAddress("f", _CONFIG + "inertia"),
    0x78: RegisterAddress("f", _CONFIG + "pos_gain"),
    0x7A: RegisterAddress("f", _CONFIG + "vel_gain"),
    0x7C: RegisterAddress("f", _CONFIG + "vel_integrator_gain"),
    ENDPOINT: RegisterAddress("H", ""),
    ENDPOINT_VALUE: RegisterAddress("I", ""),
}
