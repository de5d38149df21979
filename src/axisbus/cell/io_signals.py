"""The named inputs and outputs of a node, from its EDS and the cell file's tables."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.bus.pdo.mapping import MapEntry, map_entry_of
from axisbus.cell.model import CellConfig, IoConfig
from axisbus.cia401.signal import IoPoint
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError


def all_points(cell: CellConfig, dictionaries: Mapping[int, Eds]) -> dict[str, IoPoint]:
    """Return the points of these nodes by name, node by node, without the points that ``points_of`` leaves out."""
    return {
        point.name: point
        for node_id, eds in dictionaries.items()
        for point in points_of(cell, node_id, Dictionary(eds, node_id))
    }


def points_of(cell: CellConfig, node_id: int, dictionary: Dictionary) -> tuple[IoPoint, ...]:
    """Return the points of a node, in the file's order; a point with an error is left out (``check.io`` reports it)."""
    found = (point_of(each, dictionary) for each in cell.io_of(node_id))
    return tuple(point for point in found if point is not None)


def point_of(config: IoConfig, dictionary: Dictionary) -> IoPoint | None:
    """Return a point, None if its table has an error or its object cannot be mapped into a PDO."""
    entry = entry_of(config, dictionary)
    if entry is None or not (entry.receive or entry.transmit) or not config.at.sound("node", "object", "bit"):
        return None
    if config.bit is not None and config.bit >= entry.bits:
        return None
    point = unsafe_point(config, entry)
    if not point.output or config.safe is None:
        return point
    try:
        return unsafe_point(config, entry, safe_of(config, point))
    except ArgumentError:
        return None


def safe_of(config: IoConfig, point: IoPoint) -> int:
    """Return the raw value of the point's ``safe``; raises ArgumentError if the object cannot hold it."""
    assert config.safe is not None
    whole = config.safe == int(config.safe)
    return point.raw(int(config.safe) if whole else config.safe)


def unsafe_point(config: IoConfig, entry: MapEntry, safe: int = 0) -> IoPoint:
    """Return a point without evaluating its ``safe`` key; if the object has one bit, the point is that bit."""
    return IoPoint(
        config.name,
        config.node,
        entry.index,
        entry.subindex,
        entry.bits,
        entry.signed,
        output=entry.receive,
        bit=0 if entry.bits == 1 else config.bit,
        safe=safe,
        scale=config.scale,
        offset=config.offset,
        unit=config.unit,
    )


def entry_of(config: IoConfig, dictionary: Dictionary) -> MapEntry | None:
    """Return the object of a point; None if there is no such integer."""
    try:
        entry = dictionary.resolve(config.object)
    except ArgumentError:
        return None
    return map_entry_of(dictionary, entry.index, entry.subindex)
