"""Compare two configurations: two files, a file and a device, or a device and its EDS; pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from axisbus.bus.sdo.access import ByObjects, try_upload, why_unread
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType, Value, decode, size_in_bytes
from axisbus.cia402.objects import order
from axisbus.eds.model import Eds, Variable

Key = tuple[int, int]


_REFUSES_SCAN = 2  # bit 1 of ObjFlags (DS 306 4.6.3.3)


@dataclass(frozen=True, slots=True)
class ConfigurationSide:
    """One configuration: its name, its values, and the reasons for missing values (of a device: an SDO abort)."""

    name: str
    values: Mapping[Key, Value]
    unread: Mapping[Key, str]


@dataclass(frozen=True, slots=True)
class ConfigurationDifference:
    """One entry that differs; a value is None if that side has none, and ``note`` gives the reason."""

    variable: Variable
    left: Value | None
    right: Value | None
    note: str = ""


@dataclass(frozen=True, slots=True)
class Comparison:
    """The number of compared entries, and their differences."""

    compared: int
    differences: tuple[ConfigurationDifference, ...]


def entries(eds: Eds, *, everything: bool = False) -> Iterator[Variable]:
    """Yield the entries of a configuration: the identity and all settings; with ``everything``, all readable entries.

    DOMAINs and entries that must not be read in a scan are left out. Without ``everything``, commands (controlword, targets,
    storing) are left out, too.
    """
    for entry in eds:
        for variable in entry.subs.values():
            if not variable.readable or variable.data_type is DataType.DOMAIN:
                continue
            if variable.object_flags & _REFUSES_SCAN:
                continue
            settable = variable.writable and not order(variable.index)
            if everything or settable or variable.index == o.IDENTITY:
                yield variable


def of_file(eds: Eds, node_id: int | None) -> ConfigurationSide:
    """Return the values of a DCF or EDS: parameter values, else defaults.

    The DCF of a backup has a parameter value for each object that was readable; its defaults are not values of the device.
    """
    found = {}
    recorded = _is_backup(eds)
    for entry in eds:
        for variable in entry.subs.values():
            value = variable.initial(node_id)
            if value is not None and not (recorded and variable.parameter_value is None):
                found[variable.index, variable.subindex] = value
    return ConfigurationSide(eds.source, found, {})


def _is_backup(eds: Eds) -> bool:
    """Whether a file is a backup of a device: it has a parameter value for 1000h, a read-only object."""
    device_type = eds.get(o.DEVICE_TYPE, 0)
    return device_type is not None and device_type.parameter_value is not None


def typed(variable: Variable, data: bytes) -> Value:
    """Return the bytes from a device as a value; if their number does not match the type, return the bytes."""
    size = size_in_bytes(variable.data_type)
    return data if size is not None and size != len(data) else decode(data, variable.data_type)


def compare(variables: list[Variable], left: ConfigurationSide, right: ConfigurationSide) -> Comparison:
    """Compare entry by entry; an entry is skipped if a side has no value for it, unless a device refused to read it."""
    found: list[ConfigurationDifference] = []
    compared = 0
    for variable in variables:
        key = variable.index, variable.subindex
        note = left.unread.get(key) or right.unread.get(key) or ""
        left_value, other = left.values.get(key), right.values.get(key)
        if not note and (left_value is None or other is None):
            continue
        compared += 1
        if note or not _equal(left_value, other):
            found.append(ConfigurationDifference(variable, left_value, other, note))
    return Comparison(compared, tuple(found))


def _equal(one: Value | None, other: Value | None) -> bool:
    if isinstance(one, float) and isinstance(other, (int, float)):
        return abs(one - other) <= 1e-6 * max(1.0, abs(other))  # a REAL32 is rounded
    if isinstance(one, str) and isinstance(other, str):
        return one.strip("\0 ") == other.strip("\0 ")
    return one == other


# -- A device as one side of a comparison, read object by object -------------------------------------------------------


def against(
    node: ByObjects,
    eds: Eds,
    on_progress: Callable[[int, int], None] | None = None,
    *,
    everything: bool = False,
) -> Comparison:
    """Compare a DCF or EDS with the present values of a device; blocks for a transfer for each entry with a value in the file.

    ``everything``: as in ``compare.entries``.

    Raises:
        SdoTimeout, AdapterError: the device does not answer.
    """
    file = of_file(eds, node.node_id)
    present = [
        each for each in entries(eds, everything=everything) if (each.index, each.subindex) in file.values
    ]
    return compare(present, file, of_device(node, present, on_progress))


def of_device(
    node: ByObjects, variables: Sequence[Variable], on_progress: Callable[[int, int], None] | None = None
) -> ConfigurationSide:
    """Read ``variables`` of a device; blocks for a transfer each. Entries that cannot be read are in ``unread``.

    Raises:
        SdoTimeout, AdapterError: the device does not answer.
    """
    values, unread = {}, {}
    for number, variable in enumerate(variables, start=1):
        key = variable.index, variable.subindex
        found = try_upload(node.sdo, *key)
        if isinstance(found, bytes):
            values[key] = typed(variable, found)
        else:
            unread[key] = why_unread(found)
        if on_progress is not None:
            on_progress(number, len(variables))
    return ConfigurationSide(f"node {node.node_id}", values, unread)
