"""The controlword 6040h (CiA 402-2 8.4.1): commands of the power stage, and the bits with a mode-specific meaning."""

from __future__ import annotations

from enum import Enum

from axisbus.cia402.modes import ModeOfOperation

SWITCH_ON = 1 << 0
ENABLE_VOLTAGE = 1 << 1
QUICK_STOP = 1 << 2  # active low
ENABLE_OPERATION = 1 << 3
FAULT_RESET = 1 << 7
HALT = 1 << 8

# Profile position mode (8.4.1, 10.2).
NEW_SET_POINT = 1 << 4
CHANGE_SET_IMMEDIATELY = 1 << 5
RELATIVE = 1 << 6  # never sent: by design the master computes absolute targets
CHANGE_ON_SET_POINT = 1 << 9

# Homing mode (11.2).
HOMING_START = 1 << 4

# Interpolated position mode (12.2).
ENABLE_INTERPOLATION = 1 << 4

MODE_BITS = NEW_SET_POINT | CHANGE_SET_IMMEDIATELY | RELATIVE | CHANGE_ON_SET_POINT


class PowerCommand(Enum):
    """A command of the power stage and its controlword (CiA 402-2 table 27).

    Fault reset acts on the *rising edge* of bit 7.
    """

    SHUTDOWN = 0x0006
    SWITCH_ON = 0x0007
    ENABLE_OPERATION = 0x000F
    DISABLE_VOLTAGE = 0x0000
    QUICK_STOP = 0x0002
    FAULT_RESET = 0x0080

    @property
    def word(self) -> int:
        """The controlword, without mode-specific bits and halt."""
        return self.value


# "Disable operation" is the same word as "switch on"; the present state makes the difference.
DISABLE_OPERATION = PowerCommand.SWITCH_ON


# Meaning of bits 4, 5, 6 and 9 in each mode.
_POSITION_BITS = {4: "new set-point", 5: "change set immediately", 6: "relative", 9: "change on set-point"}
MODE_WORDS: dict[ModeOfOperation, dict[int, str]] = {
    ModeOfOperation.PROFILE_POSITION: _POSITION_BITS,
    ModeOfOperation.HOMING: {4: "homing start"},
    ModeOfOperation.INTERPOLATED_POSITION: {4: "enable interpolation"},
    ModeOfOperation.VELOCITY: {4: "enable ramp", 5: "unlock ramp", 6: "reference ramp"},
}


def words(controlword: int, mode: ModeOfOperation | None = None) -> str:
    """Return the controlword's command and set bits as text, such as ``enable operation, halt``.

    Bits 4, 5, 6 and 9 have the meaning of ``mode`` (6060h); if the mode is unknown, they are named by number.
    """
    named = [_command_text(controlword)]
    if controlword & HALT:
        named.append("halt")
    texts = MODE_WORDS.get(mode, {}) if mode is not None else {}
    named += [texts.get(bit, f"bit {bit}") for bit in (4, 5, 6, 9) if controlword >> bit & 1]
    return ", ".join(named)


def _command_text(controlword: int) -> str:
    if controlword & FAULT_RESET:
        return "fault reset"
    for mask, value, text in _PATTERNS:
        if controlword & mask == value:
            return text
    return "no command"


_PATTERNS = (
    (0x02, 0x00, "disable voltage"),
    (0x06, 0x02, "quick stop"),
    (0x07, 0x06, "shutdown"),
    (0x0F, 0x0F, "enable operation"),
    (0x0F, 0x07, "switch on / disable operation"),
)
