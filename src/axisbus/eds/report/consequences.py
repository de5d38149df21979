"""The consequences of a difference between two EDS files for the master of the drive; empty texts if there is probably none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from axisbus.cia301 import cob
from axisbus.cia301 import objects as cia301
from axisbus.cia301.pdo import is_synchronous
from axisbus.cia402 import modes as modes402
from axisbus.cia402 import objects as cia402
from axisbus.cia402 import options
from axisbus.cia402.axes import first_axis
from axisbus.eds import layout
from axisbus.eds.layout import PdoLayout
from axisbus.eds.model import BAUD_RATES, Eds, Number, Variable
from axisbus.eds.report import wording

_REFUSED = "a master that checks the identity refuses the other one"


# By key of [DeviceInfo].
DEVICE = {
    "VendorNumber": _REFUSED,
    "ProductNumber": _REFUSED,
    "RevisionNumber": "a master that checks the revision refuses the other one",
    "SimpleBootUpSlave": "whether the device boots without an NMT master",
    **{f"BaudRate_{rate}": "whether the device runs at this bit rate" for rate in BAUD_RATES},
}


_SCALE = "positions or velocities may have another scale: check scale in the cell file"
_LIMIT = "another default limit of motion or torque"
_STOP_OBJECTS = {option.index: option.title for option in options.ALL}
_OPTIONS = {(option.index, option.subindex): option for option in options.ALL}


# By object of the first axis, all sub-indices: the consequence of another default.
_DEFAULTS = {
    cia301.DEVICE_TYPE: "another kind of device or another profile",
    cia301.COB_ID_EMCY: "emergency messages come under another identifier",
    cia301.CONSUMER_HEARTBEAT: "whether, and how soon, the drive detects the loss of the master",
    cia301.PRODUCER_HEARTBEAT: "how soon the master notices a dead drive",
    cia301.GUARD_TIME: "how node guarding is armed",
    cia301.LIFE_TIME_FACTOR: "how node guarding is armed",
    cia402.MODES_OF_OPERATION: "the drive wakes in another mode",
    cia402.SUPPORTED_DRIVE_MODES: "other modes of operation are supported",
    **dict.fromkeys(
        (
            *(cia402.POLARITY, cia402.ENCODER_RESOLUTION, cia402.VELOCITY_ENCODER_RESOLUTION),
            *(cia402.GEAR_RATIO, cia402.FEED_CONSTANT, cia402.VELOCITY_FACTOR),
            *(cia402.SI_UNIT_POSITION, cia402.SI_UNIT_VELOCITY, 0x6093, 0x6094, 0x6095, 0x6097),
        ),
        _SCALE,
    ),
    **dict.fromkeys((cia402.RATED_TORQUE, cia402.RATED_CURRENT), "torques have another scale"),
    **dict.fromkeys(
        (
            *(cia402.MAX_TORQUE, 0x6073, cia402.SOFTWARE_POSITION_LIMIT, cia402.POSITION_RANGE_LIMIT),
            *(cia402.MAX_PROFILE_VELOCITY, cia402.MAX_MOTOR_SPEED, cia402.MAX_ACCELERATION),
            *(cia402.MAX_DECELERATION, 0x60E0, 0x60E1),
        ),
        _LIMIT,
    ),
    **dict.fromkeys(
        (cia402.FOLLOWING_ERROR_WINDOW, cia402.FOLLOWING_ERROR_TIME_OUT),
        "another following error leads to a fault",
    ),
    cia402.QUICK_STOP_DECELERATION: "a quick stop needs another distance and time",
    cia402.HOMING_METHOD: "another homing method, unless the master sets it",
    cia402.POSITIONING_OPTION: "how a new set-point replaces a running one",
    cia402.INTERPOLATION_TIME_PERIOD: "the period of the cyclic modes, unless the master sets it",
}


def modes(change: str) -> str:
    """Return the consequence of a mode that 6502h no longer lists, or newly lists."""
    return "commands that use these modes will be refused" if change.startswith("no") else "new ways to move"


def pdo(one: PdoLayout | None) -> str:
    """Return the consequence of a PDO that only one file has: the first (``one``), or the second (None)."""
    return f"the drive has no {one.name} any more" if one is not None else ""


def mapping(one: PdoLayout, other: PdoLayout) -> str:
    """Return the consequence of another mapping of a PDO."""
    before = {slot.mapped for slot in one.slots}
    after = {slot.mapped for slot in other.slots}
    lost = [slot.address for slot in one.slots if slot.mapped not in after]
    new = [slot.address for slot in other.slots if slot.mapped not in before]
    parts = [f"no longer carries {', '.join(lost)}"] * bool(lost) + [f"now carries {', '.join(new)}"] * bool(
        new
    )
    if not parts:
        parts = ["carries the same in another order"]
    return f"{one.name} {' and '.join(parts)}: a master that relies on the default mapping misreads it"


def data_type(a: Variable, b: Variable, _: int | None) -> str:
    """Return the consequence of another data type."""
    if a.bits != b.bits:
        return "transfers of the other size are refused, and a mapping entry needs another length"
    if a.data_type.integer and b.data_type.integer and a.data_type.signed is not b.data_type.signed:
        return "the same bits are read with or without a sign"
    return "values are encoded differently"


def access(a: Variable, b: Variable, _: int | None) -> str:
    """Return the consequence of another access type."""
    lost = []
    if a.writable and not b.writable:
        lost.append("written")
    if a.readable and not b.readable:
        lost.append("read")
    if lost:
        return f"can no longer be {' or '.join(lost)}: a master that does gets an abort"
    if wording.pdo_direction(a) != wording.pdo_direction(b):
        return "may be mapped in another direction"
    return "can now be written" if b.writable and not a.writable else ""


def mappable(a: Variable, _: Variable, __: int | None) -> str:
    """Return the consequence of another PDOMapping."""
    return "can no longer be mapped into a PDO" if a.pdo_mapping else ""


def low_limit(a: Variable, b: Variable, node_id: int | None) -> str:
    """Return the consequence of another LowLimit."""
    before, after = _number(a.low, node_id), _number(b.low, node_id)
    bottom = a.data_type.range[0] if a.data_type.integer else -math.inf
    return _NARROWER if after is not None and after > (bottom if before is None else before) else ""


def high_limit(a: Variable, b: Variable, node_id: int | None) -> str:
    """Return the consequence of another HighLimit."""
    before, after = _number(a.high, node_id), _number(b.high, node_id)
    top = a.data_type.range[1] if a.data_type.integer else math.inf
    return _NARROWER if after is not None and after < (top if before is None else before) else ""


_NARROWER = "values that were allowed may be refused"


def default(a: Variable, b: Variable, node_id: int | None) -> str:
    """Return the consequence of another default or parameter value."""
    before, after = a.initial(node_id), b.initial(node_id)
    if cia301.is_pdo_parameter(a.index):
        return _pdo_parameter(a, before, after)
    index = first_axis(a.index)
    if index == cia301.COB_ID_SYNC:
        return _sync(before, after)
    if index == cia301.IDENTITY:
        return (
            _REFUSED if a.subindex in (cia301.VENDOR_ID, cia301.PRODUCT_CODE, cia301.REVISION_NUMBER) else ""
        )
    option = _OPTIONS.get((index, a.subindex))
    if option is not None and isinstance(before, int) and isinstance(after, int):
        return f"{option.title}: {option.meaning(before)} -> {option.meaning(after)}"
    return "" if a.subindex == 0 and index in _ARRAYS else _DEFAULTS.get(index, "")


# Their sub-index 0 is only a count.
_ARRAYS = frozenset(
    (
        *(cia301.CONSUMER_HEARTBEAT, cia402.ENCODER_RESOLUTION, cia402.GEAR_RATIO, cia402.FEED_CONSTANT),
        *(cia402.SOFTWARE_POSITION_LIMIT, cia402.POSITION_RANGE_LIMIT, cia402.INTERPOLATION_TIME_PERIOD),
    )
)


def presence(eds: Eds, index: int, subindex: int | None, removed: bool) -> str:
    """Return the consequence of an object or entry of ``eds`` that is missing in the newer (``removed``) or the older file."""
    if not removed:
        return ""
    first = first_axis(index)
    if first in (cia402.CONTROLWORD, cia402.STATUSWORD):
        return "no drive can be run without it"
    needing = [facts.short for facts in modes402.FACTS.values() if first in facts.required]
    if needing and not subindex:
        return f"needed by {' '.join(needing)}"
    if first in _STOP_OBJECTS:
        return f"the reaction {_STOP_OBJECTS[first]} can no longer be set"
    if subindex is None and cia301.is_pdo_parameter(index):
        return ""  # reported for the PDO as a whole
    mapped_in = [
        each.name
        for each in layout.layouts(eds, None)
        if any(slot.mapped.index == index and subindex in (None, slot.mapped.subindex) for slot in each.slots)
    ]
    if mapped_in:
        return f"{', '.join(mapped_in)} carried it"
    return "it affected properties that the master relies on" if first in _DEFAULTS else ""


def _sync(before: object, after: object) -> str:
    """Return the consequence of another value of 1005h; bit 30 says whether the device produces SYNC (CiA 301 7.5.2.5)."""
    if not isinstance(before, int) or not isinstance(after, int):
        return ""
    if (before ^ after) & cob.ID_MASK_29:
        return "SYNC travels under another identifier"
    if (before ^ after) & cob.NO_RTR:
        return "now produces SYNC itself" if after & cob.NO_RTR else "no longer produces SYNC"
    return ""


def _pdo_parameter(a: Variable, before: object, after: object) -> str:
    if not isinstance(before, int) or not isinstance(after, int) or cia301.is_pdo_mapping(a.index):
        return ""
    if a.subindex == cia301.PDO_COB_ID:
        if (before ^ after) & cob.INVALID:
            return "now switched off" if after & cob.INVALID else "now switched on"
        return "travels under another identifier" if (before ^ after) & cob.ID_MASK_29 else ""
    if a.subindex == cia301.PDO_TRANSMISSION_TYPE:
        if is_synchronous(before) != is_synchronous(after):
            return "now synchronous" if is_synchronous(after) else "no longer synchronous"
        return "comes at other times" if is_synchronous(after) else ""
    return "comes at other times" if a.subindex <= cia301.PDO_EVENT_TIMER else ""


def _number(given: Number | float | None, node_id: int | None) -> float | None:
    return given.resolve(node_id) if isinstance(given, Number) else given


# -- One difference between two EDS files, as a value ------------------------------------------------------------------


class DifferenceGroup(Enum):
    """The subject of a difference, the most important first."""

    IDENTITY = "identity"
    PDO = "PDOs"
    REMOVED = "removed"
    TYPES = "types and access"
    LIMITS = "limits"
    DEFAULTS = "defaults"
    NAMES = "names"
    ADDED = "added"


@dataclass(frozen=True, slots=True)
class EdsDifference:
    """One difference between file A and file B.

    ``what`` names it, ``a`` and ``b`` are the two sides as texts (empty: absent), ``matters`` is the consequence for a master
    (empty: probably none). ``line_a`` and ``line_b`` count from 1, 0 if there is no line.
    """

    group: DifferenceGroup
    what: str
    a: str
    b: str
    index: int | None = None
    subindex: int | None = None
    matters: str = ""
    line_a: int = 0
    line_b: int = 0
