"""The writes of a cell file to a drive's objects at boot, resolved by the drive's dictionary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from axisbus.cell.model import AxisConfig, NodeConfig, ObjectSetting
from axisbus.cell.quantities import DRIVE, units_of
from axisbus.cia301.datatypes import Value
from axisbus.cia402 import objects, options
from axisbus.cia402.axes import own_index
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError

# 607Eh: position and velocity are multiplied by -1 (CiA 402-2, polarity: bits 7 and 6).
POLARITY_TURNED = 0xC0


@dataclass(frozen=True, slots=True)
class CellWrite:
    """One value to write; the index is the device's own. ``source`` names the entry of the cell file that asks for it."""

    index: int
    subindex: int
    value: int | float | str
    line: int
    source: str

    @property
    def address(self) -> tuple[int, int]:
        """Index and sub-index."""
        return self.index, self.subindex


def node_writes(node: NodeConfig, dictionary: Dictionary) -> tuple[CellWrite, ...]:
    """Return the writes of ``[nodes.N.objects]``, in the file's order.

    Raises:
        ArgumentError: a key names no object.
    """
    return tuple(setting_write(setting, dictionary) for setting in node.objects)


def axis_writes(axis: AxisConfig, dictionary: Dictionary) -> tuple[CellWrite, ...]:
    """Return the writes of an axis: its objects in the file's order, then those that its other entries imply.

    In ``[axes.NAME.objects]`` the indices 6000h to 67FFh are those of a single-axis drive, shifted to the axis's own.

    Raises:
        ArgumentError: a key names no object.
    """
    own = tuple(setting_write(setting, dictionary, axis.drive_axis) for setting in axis.objects)
    given = {write.address for write in own}
    return (*own, *implied_writes(axis, frozenset(given)))


def setting_write(setting: ObjectSetting, dictionary: Dictionary, drive_axis: int = 1) -> CellWrite:
    """Return the write of one line of an ``objects`` table.

    Raises:
        ArgumentError: its key names no object.
    """
    entry = resolve(setting.key, dictionary, drive_axis)
    return CellWrite(
        entry.index, entry.subindex, setting.value, setting.line, f"{setting.key} in [{setting.table}]"
    )


def known_writes(
    settings: tuple[ObjectSetting, ...], dictionary: Dictionary, drive_axis: int = 1
) -> list[CellWrite]:
    """Return the writes of an ``objects`` table; lines whose key names no object are left out."""
    found = []
    for setting in settings:
        try:
            found.append(setting_write(setting, dictionary, drive_axis))
        except ArgumentError:
            continue  # ``check.objects`` reports it
    return found


def resolve(key: str, dictionary: Dictionary, drive_axis: int = 1) -> DictionaryEntry:
    """Return the entry of ``key``, such as ``6065``, ``607Dh:01`` (both hexadecimal) or a name of the EDS.

    Raises:
        ArgumentError: it names no object.
    """
    entry = dictionary.resolve(key)
    own = own_index(entry.index, drive_axis)
    return entry if own == entry.index else dictionary.entry(own, entry.subindex)


def implied_writes(axis: AxisConfig, given: frozenset[tuple[int, int]] = frozenset()) -> Iterator[CellWrite]:
    """Yield the writes that ``[axes.NAME.stop]``, ``[axes.NAME.homing] offset`` and ``invert = "drive"`` imply.

    ``given`` contains the addresses that ``[axes.NAME.objects]`` writes: an explicit polarity is not changed.
    """
    units, stop = units_of(axis), axis.stop
    for option in options.ALL:
        word = stop.word(option.key)
        if word is not None:
            value = option.words[word]
            yield _write(
                axis,
                option.index,
                option.subindex,
                value,
                stop.at.of(option.key),
                f"{option.key} in [{stop.at.name}]",
            )
    if stop.deceleration is not None:
        value = round(stop.deceleration * abs(units.acceleration.factor))
        index = objects.QUICK_STOP_DECELERATION
        yield _write(axis, index, 0, value, stop.at.of("deceleration"), f"deceleration in [{stop.at.name}]")
    if axis.homing.offset is not None:
        at = axis.homing.at
        value = units.position.to_increments(axis.homing.offset)
        yield _write(axis, objects.HOME_OFFSET, 0, value, at.of("offset"), f"offset in [{at.name}]")
    polarity = (own_index(objects.POLARITY, axis.drive_axis), 0)
    if axis.invert == DRIVE and polarity not in given:
        yield CellWrite(*polarity, POLARITY_TURNED, axis.at.of("invert"), f"invert in [{axis.at.name}]")


def _write(axis: AxisConfig, index: int, subindex: int, value: int, line: int, source: str) -> CellWrite:
    return CellWrite(own_index(index, axis.drive_axis), subindex, value, line, source)


def is_fixed(write: CellWrite, eds: Eds) -> bool:
    """Whether the EDS has the object of a write as read-only: then boot compares it instead."""
    variable = eds.get(*write.address)
    return variable is not None and not variable.writable


def initial(dictionary: Dictionary, node_id: int, index: int, subindex: int) -> Value | None:
    """Return the value of an object at power-up by the EDS or DCF; None if they have none."""
    variable = dictionary.eds.get(index, subindex) if dictionary.eds is not None else None
    return None if variable is None else variable.initial(node_id)
