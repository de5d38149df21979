"""The statusword 6041h (CiA 402-2 8.4.2): its bits, and the meaning of bits 12 and 13 in each mode."""

from __future__ import annotations

from axisbus.cia402.modes import ModeOfOperation

READY_TO_SWITCH_ON = 1 << 0
SWITCHED_ON = 1 << 1
OPERATION_ENABLED = 1 << 2
FAULT = 1 << 3
VOLTAGE_ENABLED = 1 << 4
QUICK_STOP = 1 << 5  # active low
SWITCH_ON_DISABLED = 1 << 6
WARNING = 1 << 7
MANUFACTURER_8 = 1 << 8
REMOTE = 1 << 9
TARGET_REACHED = 1 << 10
INTERNAL_LIMIT = 1 << 11
BIT_12 = 1 << 12
BIT_13 = 1 << 13

# Bits 12 and 13 by mode.
SET_POINT_ACKNOWLEDGE = BIT_12  # pp
FOLLOWING_ERROR = BIT_13  # pp, csp
SPEED_ZERO = BIT_12  # pv
MAX_SLIPPAGE = BIT_13  # pv
HOMING_ATTAINED = BIT_12  # hm
HOMING_ERROR = BIT_13  # hm
FOLLOWS_COMMAND = BIT_12  # csp, csv, cst: "drive follows the command value"

_CYCLIC_MODES = frozenset(
    {
        ModeOfOperation.CYCLIC_SYNC_POSITION,
        ModeOfOperation.CYCLIC_SYNC_VELOCITY,
        ModeOfOperation.CYCLIC_SYNC_TORQUE,
    }
)

COMMON_BITS = {
    4: "voltage enabled",
    7: "warning",
    8: "manufacturer bit 8",
    9: "remote",
    10: "target reached",
    11: "internal limit active",
}

_POSITION = {12: "set-point acknowledge", 13: "following error"}
_CYCLIC = {12: "follows the command", 13: "following error"}
MODE_BITS: dict[ModeOfOperation, dict[int, str]] = {
    ModeOfOperation.PROFILE_POSITION: _POSITION,
    ModeOfOperation.PROFILE_VELOCITY: {12: "speed is zero", 13: "max slippage"},
    ModeOfOperation.HOMING: {12: "homing attained", 13: "homing error"},
    ModeOfOperation.INTERPOLATED_POSITION: {12: "interpolation active"},
    ModeOfOperation.CYCLIC_SYNC_POSITION: _CYCLIC,
    ModeOfOperation.CYCLIC_SYNC_VELOCITY: _CYCLIC,
    ModeOfOperation.CYCLIC_SYNC_TORQUE: {12: "follows the command"},
}


def bit_words(statusword: int, mode: ModeOfOperation | None = None) -> list[str]:
    """Return the names of the set bits that are not part of the state, bits 12 and 13 by ``mode`` (6061h)."""
    texts = dict(COMMON_BITS)
    texts.update(MODE_BITS.get(mode, {}) if mode is not None else {})
    for bit in (12, 13):
        texts.setdefault(bit, f"bit {bit}")
    return [texts[bit] for bit in sorted(texts) if statusword >> bit & 1]


def hints(statusword: int, mode: int | None = None) -> list[str]:
    """Return possible reasons why a drive cannot be enabled or moved, by bits 4, 7, 9 and 11, and bit 12 in a cyclic ``mode``."""
    found = []
    if not statusword & VOLTAGE_ENABLED:
        found.append("bit 4 (voltage enabled) is 0: the power supply of the motor is off or not ready")
    if not statusword & REMOTE:
        found.append(
            "bit 9 (remote) is 0: the drive is under local control (keypad, commissioning tool) and ignores the bus"
        )
    if statusword & INTERNAL_LIMIT:
        found.append(
            "bit 11 (internal limit active) is 1: a limit switch, software limit or torque limit holds the drive"
        )
    if statusword & WARNING:
        found.append("bit 7 (warning) is 1: read the drive's error history (1003h)")
    if mode in _CYCLIC_MODES and not statusword & FOLLOWS_COMMAND:
        found.append("bit 12 is 0: in a cyclic mode the drive says by it that it does not follow its targets")
    return found
