"""Modes of operation (CiA 402-2 8.4.9, objects 6060h, 6061h, 6502h) and the objects that each needs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from axisbus.cia402 import homing, objects


class ModeOfOperation(IntEnum):
    """Value of 6060h and 6061h; negative values are manufacturer-specific, and an unknown value becomes a member, too."""

    NONE = 0
    PROFILE_POSITION = 1
    VELOCITY = 2
    PROFILE_VELOCITY = 3
    PROFILE_TORQUE = 4
    HOMING = 6
    INTERPOLATED_POSITION = 7
    CYCLIC_SYNC_POSITION = 8
    CYCLIC_SYNC_VELOCITY = 9
    CYCLIC_SYNC_TORQUE = 10
    CYCLIC_SYNC_TORQUE_ANGLE = 11

    @classmethod
    def _missing_(cls, value: object) -> ModeOfOperation | None:
        if not isinstance(value, int):
            return None
        member = int.__new__(cls, value)
        member._name_ = f"MODE_{value}" if value >= 0 else f"MAKER_{-value}"
        member._value_ = value
        return member

    @property
    def text(self) -> str:
        """The standard's name, such as ``profile position``."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True, slots=True)
class ModeFacts:
    """Properties of a mode in CiA 402: short name, bit of 6502h, mandatory objects, and whether targets come with SYNC."""

    short: str
    supported_bit: int
    required: tuple[int, ...]
    cyclic: bool = False


_M = ModeOfOperation
FACTS: dict[ModeOfOperation, ModeFacts] = {
    _M.PROFILE_POSITION: ModeFacts(
        "pp",
        0,
        (
            objects.TARGET_POSITION,
            objects.PROFILE_VELOCITY,
            objects.PROFILE_ACCELERATION,
            objects.POSITION_ACTUAL,
        ),
    ),
    _M.VELOCITY: ModeFacts("vl", 1, (0x6042, 0x6043, 0x6044, 0x6046, 0x6048)),
    _M.PROFILE_VELOCITY: ModeFacts(
        "pv", 2, (objects.TARGET_VELOCITY, objects.VELOCITY_ACTUAL, objects.PROFILE_ACCELERATION)
    ),
    _M.PROFILE_TORQUE: ModeFacts("tq", 3, (objects.TARGET_TORQUE, objects.TORQUE_SLOPE)),
    _M.HOMING: ModeFacts("hm", 5, (objects.HOMING_METHOD, objects.HOMING_SPEEDS)),
    _M.INTERPOLATED_POSITION: ModeFacts("ip", 6, (0x60C1, objects.POSITION_ACTUAL), cyclic=True),
    _M.CYCLIC_SYNC_POSITION: ModeFacts(
        "csp", 7, (objects.TARGET_POSITION, objects.POSITION_ACTUAL), cyclic=True
    ),
    _M.CYCLIC_SYNC_VELOCITY: ModeFacts(
        "csv", 8, (objects.TARGET_VELOCITY, objects.VELOCITY_ACTUAL), cyclic=True
    ),
    _M.CYCLIC_SYNC_TORQUE: ModeFacts("cst", 9, (objects.TARGET_TORQUE, objects.TORQUE_ACTUAL), cyclic=True),
    _M.CYCLIC_SYNC_TORQUE_ANGLE: ModeFacts(
        "cstca", 10, (objects.TARGET_TORQUE, objects.TORQUE_ACTUAL, 0x60EA), cyclic=True
    ),
}


# Objects that the master needs, if these are fewer than CiA 402 requires of the drive; it works without the others.
_NEEDED: dict[ModeOfOperation, tuple[int, ...]] = {
    _M.PROFILE_POSITION: (objects.TARGET_POSITION, objects.PROFILE_VELOCITY, objects.PROFILE_ACCELERATION),
    _M.PROFILE_VELOCITY: (objects.TARGET_VELOCITY, objects.PROFILE_ACCELERATION),
    _M.PROFILE_TORQUE: (objects.TARGET_TORQUE,),
    _M.HOMING: (objects.HOMING_METHOD,),
}


def needed(mode: ModeOfOperation, method: int | None = None) -> tuple[int, ...]:
    """Return the objects that the master needs for ``mode``; ``method``: the homing method (6098h)."""
    own = _NEEDED.get(mode, FACTS[mode].required)
    moves = mode is _M.HOMING and method is not None and homing.needs_speeds(method)
    return (*own, objects.HOMING_SPEEDS) if moves else own


def supported(word: int) -> list[ModeOfOperation]:
    """Return the modes that a value of 6502h declares."""
    return [mode for mode, facts in FACTS.items() if word >> facts.supported_bit & 1]


def short(mode: ModeOfOperation) -> str:
    """Return the mode's short name, such as ``pp``."""
    return FACTS[mode].short if mode in FACTS else mode.text
