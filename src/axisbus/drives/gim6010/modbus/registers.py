"""The Modbus RTU registers as one table (manual v2.2, 4.3.2, 4.3.3), from which they are read, written and documented.

If the manual does not document a property of a register, but that of the parameter with the same name over USB and CAN Simple
(unit, side of the gear, bounds), the table uses the latter; docs/gim6010-8.md lists these cases.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from axisbus.cia301.tables import rows
from axisbus.drives.gim6010.can_simple.fields import FLOAT32, MessageField, Number, from_row
from axisbus.drives.gim6010.can_simple.messages import CONTROL_MODES, INPUT_MODES
from axisbus.errors import ArgumentError

_BITS = 16  # of one register
FACTORY_RATE = 115200  # bit/s, also the highest (4.3)
RATES = (9600, 19200, 38400, 57600, FACTORY_RATE)
HIGHEST_DEVICE = 247  # Modbus over serial line, 2.2; 0 is broadcast, without answers


class Bank(Enum):
    """Address space of a register, with the function code that reads it (4.3.1)."""

    INPUT = 0x04
    HOLDING = 0x03


class RegisterKind(Enum):
    """Purpose of a register."""

    MEASURED = "is measured"
    SETTING = "is a setting"
    MODE = "is a control mode"
    TARGET = "is a set-point"
    STATE = "requests a state"
    ADDRESS = "is the address of the module"
    ACT = "acts on any written value"
    ENDPOINT = "accesses parameters by number"


@dataclass(frozen=True, slots=True, repr=False)
class Register:
    """One value: its first address, the manual's ``title``, and the field with its name, type, unit, side of the gear and bounds.

    ``access`` are the requests that the manual shows: r, w or rw. A value of several registers has its highest 16 bits at the
    lowest address, and is always read or written as a whole.
    """

    address: int
    title: str
    field: MessageField
    bank: Bank
    kind: RegisterKind
    access: str
    note: str = ""

    def __repr__(self) -> str:
        return f"<{self.address:02X}h {self.name}>"

    @property
    def name(self) -> str:
        return self.field.name

    @property
    def count(self) -> int:
        return self.field.type.bits // _BITS

    @property
    def readable(self) -> bool:
        """Whether the manual shows a read."""
        return "r" in self.access

    @property
    def writable(self) -> bool:
        """Whether the manual shows a write."""
        return "w" in self.access

    def words(self, value: Number) -> tuple[int, ...]:
        """Return its registers for a value in its unit, most significant first.

        Raises:
            ArgumentError: not a number, not finite, or not in the manual's list of values.
            LimitError: beyond its bounds or its type.
        """
        raw = self.field.raw(value + 0.0 if self.field.type is FLOAT32 else value)  # no negative zero
        return tuple(raw >> _BITS * place & 0xFFFF for place in reversed(range(self.count)))

    def value(self, words: tuple[int, ...]) -> Number:
        """Return the value of its registers, in its unit; a float32 may be NaN or infinite, if the module reports that."""
        raw = 0
        for word in words:
            raw = raw << _BITS | word
        return self.field.take(raw.to_bytes(2 * self.count, "little"))


# The permitted values: of the states only those that do not move the motor; 4.3.3 lists neither voltage control nor MIT.
_LISTED: Mapping[str, Mapping[int, str]] = {
    "state_control": {1: "idle", 8: "closed loop"},
    "control_mode": {mode: CONTROL_MODES[mode] for mode in (1, 2, 3)},
    "input_mode": {mode: INPUT_MODES[mode] for mode in (1, 2, 3, 5, 6)},
}
# From ``registers.tsv``, with the bounds of the same parameters over CAN Simple.
REGISTERS = tuple(
    Register(
        int(row["address"], 16),
        row["title"],
        from_row(row, _LISTED.get(row["name"], {})),
        Bank[row["bank"]],
        RegisterKind[row["kind"]],
        row["access"],
        row["note"],
    )
    for row in rows(__package__, "registers.tsv")
)
BY_NAME = {each.name: each for each in REGISTERS}
# Bits of error_flags: the error words that are not 0, with their category in the fault table (5.7 calls the axis "driver").
ERROR_FLAGS = {
    0: ("motor_error", "motor"),
    1: ("encoder_error", "encoder"),
    2: ("controller_error", "controller"),
    3: ("system_error", "system"),
    4: ("driver_error", "axis"),
}
ALIVE_IN_CLOSED_LOOP = ("position_feedback", "velocity_feedback")
OTHER_FLAGS = 0xFFE0  # reserved bits, and the upper byte that is always 0


def named(name: str) -> Register:
    """Return a register by its name. Raises ArgumentError: no register has this name."""
    if name not in BY_NAME:
        raise ArgumentError(f"Modbus has no register {name!r}", remedy=f"there are {', '.join(BY_NAME)}")
    return BY_NAME[name]
