"""Bits of controlword and statusword for the simulated drive, copied from CiA 402-2 and independent of the master's code."""

from __future__ import annotations

# Controlword 6040h.
CW_ENABLE_VOLTAGE = 0x0002
CW_QUICK_STOP_LOW = 0x0004  # 0 requests a quick stop
CW_BIT_4 = 0x0010  # new set-point (pp), homing start (hm)
CW_IMMEDIATELY = 0x0020
CW_RELATIVE = 0x0040
CW_FAULT_RESET = 0x0080
CW_HALT = 0x0100
CW_CHANGE_ON_SET_POINT = 0x0200

# Statusword 6041h, without the state.
SW_VOLTAGE = 0x0010
SW_WARNING = 0x0080
SW_REMOTE = 0x0200
SW_BIT_10 = 0x0400
SW_INTERNAL_LIMIT = 0x0800
SW_BIT_12 = 0x1000
SW_BIT_13 = 0x2000

# Modes of operation, 6060h and 6061h.
PP, VL, PV, TQ, HM, IP, CSP, CSV, CST = 1, 2, 3, 4, 6, 7, 8, 9, 10


def as_int32(value: int) -> int:
    """Wrap into INTEGER32."""
    return (value + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000


def as_int16(value: int) -> int:
    """Wrap into INTEGER16."""
    return (value + 0x8000) % 0x1_0000 - 0x8000


def as_int8(value: int) -> int:
    """Wrap into INTEGER8."""
    return (value + 0x80) % 0x100 - 0x80
