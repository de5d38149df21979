"""Check the cell file's writes to objects: each object exists, is writable, and can hold the value."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.cell.axis_description import Drive
from axisbus.cell.model import ObjectSetting
from axisbus.cell.parameters import modes
from axisbus.cell.problem import CellProblem
from axisbus.cell.read_only_values import contradictions
from axisbus.cell.writes import CellWrite, initial, is_fixed, known_writes, resolve, setting_write
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia301 import objects as cia301
from axisbus.cia301.datatypes import DataType
from axisbus.cia402 import objects
from axisbus.cia402.axes import PROFILE_AREA, first_axis, indices_of
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError

_TEXT_TYPES = (DataType.VISIBLE_STRING, DataType.UNICODE_STRING)
_REAL_TYPES = (DataType.REAL32, DataType.REAL64)

_COMMANDED = "the master commands it; a value here would move the motor or switch it on"
_STORED = "this would store or reset the drive's parameters at every boot, and wear its memory out"
_PDO = "PDO parameters need an order of their own"

# Index or range -> why an objects table must not write it, and the alternative.
_FORBIDDEN: tuple[tuple[range, str, str], ...] = (
    (range(objects.CONTROLWORD, objects.CONTROLWORD + 1), _COMMANDED, "delete this line"),
    (range(objects.MODES_OF_OPERATION, objects.MODES_OF_OPERATION + 1), _COMMANDED, "delete this line"),
    (range(objects.TARGET_TORQUE, objects.TARGET_TORQUE + 1), _COMMANDED, "delete this line"),
    (range(objects.TARGET_POSITION, objects.TARGET_POSITION + 1), _COMMANDED, "delete this line"),
    (range(objects.TARGET_VELOCITY, objects.TARGET_VELOCITY + 1), _COMMANDED, "delete this line"),
    (range(cia301.STORE_PARAMETERS, cia301.RESTORE_DEFAULTS + 1), _STORED, "do it once, by hand"),
    (range(cia301.RPDO_COMMUNICATION, 0x1C00), _PDO, "use [nodes.N.pdo.rpdo1] or [nodes.N.pdo.tpdo1] and the like"),
)  # fmt: skip

# Objects that the master sets, with the entry of the cell file that defines the value.
_SET_BY_AXISBUS = {
    cia301.CONSUMER_HEARTBEAT: "heartbeat in [bus]",
    cia301.PRODUCER_HEARTBEAT: "heartbeat in [bus]",
    objects.INTERPOLATION_TIME_PERIOD: "scan_period in [bus]",
}


def node_objects(case: CheckContext) -> Problems:
    """Check the writes of ``[nodes.N.objects]``."""
    for node, eds, dictionary in case.nodes:
        for setting in node.objects:
            yield from _setting(case, setting, dictionary, eds, 1)


def axis_objects(case: CheckContext) -> Problems:
    """Check the writes of ``[axes.NAME.objects]``, and that they stay within the axis's objects."""
    for drive in case.drives:
        own = indices_of(drive.axis.drive_axis)
        for setting in drive.axis.objects:
            yield from _setting(case, setting, drive.dictionary, drive.eds, drive.axis.drive_axis, own)


def implied(case: CheckContext) -> Problems:
    """Check the writes of an axis's other keys: stop reactions, deceleration, home offset, polarity."""
    for drive in case.drives:
        explicit = {setting.line for setting in (*drive.node.objects, *drive.axis.objects)}
        for write in drive.written.values():
            if write.line in explicit:
                continue
            if is_fixed(write, drive.eds):
                yield _compared(case, write, drive)
            else:
                yield from _write(case, write, drive.dictionary, drive.eds)


def _compared(case: CheckContext, write: CellWrite, drive: Drive) -> CellProblem:
    """Report an entry that boot only compares, because it is read-only in the EDS; an error if the EDS has another value."""
    entry, variable = drive.dictionary.entry(*write.address), drive.eds.get(*write.address)
    assert variable is not None
    access = f"{drive.eds.source}:{variable.line}: its access is {variable.access}"
    value = initial(drive.dictionary, drive.node.node_id, *write.address)
    if value is not None and value != write.value:
        return case.error(
            write.line,
            f"{write.source}: {entry} cannot be written, and has another value",
            f"{access}, and it is {value!r}; {write.value!r} is wanted",
            f"accept {value!r}, delete this line, or correct the access in the EDS",
        )
    known = "has no value for it" if value is None else "has that value"
    return case.note(
        write.line,
        f"{write.source}: {entry} cannot be written: boot compares it with {write.value!r}",
        f"{access}; the EDS {known}",
        "if boot finds another value, set the object with the manufacturer's tool, or delete this line",
    )


def written_twice(case: CheckContext) -> Problems:
    """Check that no two entries write different values into one object."""
    for node, _, dictionary in case.nodes:
        earlier: dict[tuple[int, int], CellWrite] = {}
        for write in _explicit(case, node.node_id, dictionary):
            other = earlier.setdefault(write.address, write)
            if other.value != write.value:
                entry = dictionary.entry(*write.address)
                yield case.error(
                    write.line,
                    f"{entry} is written twice: {other.value!r} by {other.source}, {write.value!r} by {write.source}",
                    f"the first is at line {other.line}",
                    "delete one of them",
                )


def _explicit(case: CheckContext, node_id: int, dictionary: Dictionary) -> Iterator[CellWrite]:
    """Return all writes to a node, including the keys of its axes, in their order."""
    node = case.cell.nodes[node_id]
    drives = [drive for drive in case.drives if drive.node is node]
    yield from known_writes(node.objects, dictionary)
    for drive in drives:
        yield from known_writes(drive.axis.objects, dictionary, drive.axis.drive_axis)
    lines = {setting.line for drive in drives for setting in (*node.objects, *drive.axis.objects)}
    for drive in drives:
        yield from (write for write in drive.written.values() if write.line not in lines)


def _setting(
    case: CheckContext,
    setting: ObjectSetting,
    dictionary: Dictionary,
    eds: Eds,
    drive_axis: int,
    own: range | None = None,
) -> Problems:
    try:
        entry = resolve(setting.key, dictionary, drive_axis)
    except ArgumentError as error:
        yield case.error(setting.line, f"[{setting.table}]: {error.message}", error.observed, error.remedy)
        return
    if own is not None and entry.index in PROFILE_AREA and entry.index not in own:
        yield case.error(
            setting.line,
            f"[{setting.table}]: {entry} is not an object of this axis",
            f"its own are {own[0]:04X}h to {own[-1]:04X}h",
            "write it in the table of the axis that it belongs to",
        )
        return
    refusal = _refusal(case, setting, entry)
    if refusal is not None:
        yield refusal
        return
    yield from _write(case, setting_write(setting, dictionary, drive_axis), dictionary, eds)


def _refusal(case: CheckContext, setting: ObjectSetting, entry: DictionaryEntry) -> CellProblem | None:
    index = first_axis(entry.index)
    for indices, why, remedy in _FORBIDDEN:
        if index in indices:
            return case.error(setting.line, f"[{setting.table}] must not write {entry}", why, remedy)
    if index in _SET_BY_AXISBUS:
        return case.warning(
            setting.line,
            f"[{setting.table}]: {entry} is overwritten by the master",
            f"it follows from {_SET_BY_AXISBUS[index]}",
            f"delete this line and set {_SET_BY_AXISBUS[index]}",
        )
    return None


def _write(case: CheckContext, write: CellWrite, dictionary: Dictionary, eds: Eds) -> Problems:
    entry = dictionary.entry(*write.address)
    variable = eds.get(*write.address)
    if variable is None:
        yield case.error(
            write.line,
            f"{write.source}: the drive has no {entry}",
            f"{eds.source} does not have it",
            "delete this line, or name the EDS of the present drive",
        )
    elif not variable.writable:
        yield case.error(
            write.line,
            f"{write.source}: {entry} cannot be written",
            f"{eds.source}:{variable.line}: its access is {variable.access}",
            "delete this line",
        )
    else:
        why_unfit = _unfit(write.value, entry)
        if why_unfit:
            yield case.error(
                write.line,
                f"{write.source}: {entry} cannot hold {write.value!r}",
                why_unfit,
                "correct the value",
            )


def _unfit(value: int | float | str, entry: DictionaryEntry) -> str:
    """Return the type or range of an entry that cannot hold the value; empty if the value fits."""
    data_type = entry.data_type
    if data_type is None:
        return ""
    if isinstance(value, str) or data_type in _TEXT_TYPES:
        fits = isinstance(value, str) and data_type in _TEXT_TYPES
        return "" if fits else f"it is a {data_type.name}"
    if data_type in _REAL_TYPES:
        return ""
    if not data_type.integer:
        return f"it is a {data_type.name}, which a cell file cannot write"
    if value != int(value):
        return f"it is an {data_type.name}: whole numbers only"
    low, high = data_type.range
    if not low <= value <= high:
        return f"it is an {data_type.name}: {low} to {high}"
    return _beyond_limits(value, entry)


def _beyond_limits(value: float, entry: DictionaryEntry) -> str:
    low, high = entry.low, entry.high
    if (low is None or value >= low) and (high is None or value <= high):
        return ""
    return f"its EDS allows {'any' if low is None else low} to {'any' if high is None else high}"


def commanded(case: CheckContext) -> Problems:
    """Warn of entries that a command has to set but cannot: they are read-only in the EDS, with another value."""
    for drive in case.drives:
        if not drive.axis.at.sound("scale", "velocity_scale", "acceleration_scale"):
            continue
        for found in contradictions(drive, case.cell.bus.scan_period, modes(drive), drive.number):
            yield case.warning(found.line, found.message, found.observed, found.remedy)


CHECKS: tuple[Check, ...] = (node_objects, axis_objects, implied, written_twice, commanded)
