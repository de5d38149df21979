"""Set outputs to their safe states without the scan, by SDO: SDO works even if PDOs do not, and the result is read back.

An output is changed within the present value of its object, so that other bits stay as they are.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from itertools import groupby

from axisbus.boot.objects import NodeObjects
from axisbus.bus.parallel import in_parallel
from axisbus.cia401.signal import Address, IoPoint
from axisbus.errors import AxisbusError, SdoTimeout, one_line
from axisbus.link import Unsafe


def make_safe(objects: Mapping[int, NodeObjects], points: Collection[IoPoint]) -> list[Unsafe]:
    """Set ``points`` to their safe states, all nodes at the same time; return those not confirmed. Raises no bus error; blocks."""
    nodes = sorted({point.node for point in points})
    own = [[point for point in points if point.node == node] for node in nodes]
    found = in_parallel(lambda node, mine: _of_node(objects[node], mine), nodes, own)
    return [unsafe for each in found for unsafe in each]


def _of_node(objects: NodeObjects, points: list[IoPoint]) -> list[Unsafe]:
    """Set one object after the other; when the node does not answer, skip the rest."""
    ordered, found = sorted(points, key=_address), list[Unsafe]()
    for address, mine in groupby(ordered, _address):
        try:
            found += _of_object(objects, address, list(mine))
        except SdoTimeout as error:
            rest = ordered[next(at for at, point in enumerate(ordered) if point.address == address) :]
            return [*found, *(_unsafe(point, one_line(error)) for point in rest)]
    return found


def _address(point: IoPoint) -> Address:
    return point.address


def _of_object(objects: NodeObjects, address: Address, points: list[IoPoint]) -> list[Unsafe]:
    try:
        before = _read(objects, address)
        wanted = _with(points, before)
        if before == wanted:
            return []
        objects.write_unchecked(*address, wanted)
        after = _read(objects, address)
    except SdoTimeout:
        raise
    except AxisbusError as error:
        return [_unsafe(point, one_line(error)) for point in points]
    return [
        _unsafe(point, f"{point.safe} was written, and {point.of(after)} was read back")
        for point in points
        if point.of(after) != point.safe
    ]


def _with(points: Iterable[IoPoint], word: int) -> int:
    for point in points:
        word = point.into(word, point.safe)
    return word


def _read(objects: NodeObjects, address: Address) -> int:
    value = objects.read(*address)
    assert isinstance(value, int)
    return int(value)


def _unsafe(point: IoPoint, text: str) -> Unsafe:
    return Unsafe(point.name, point.node, f"{point.object_text} of node {point.node}: {text}")
