"""Prepare the outputs of a module at boot: their behaviour without the master, and the output bits of a drive that act.

Each object is read, changed only in the bits of the cell's own outputs, written, and read back.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from axisbus.boot.objects import NodeObjects, read_int
from axisbus.cia301 import objects as o301
from axisbus.cia401.objects import (
    DRIVE_OUTPUTS,
    ERROR_OBJECTS,
    MASK,
    NO_CHANGE,
    OUTPUTS,
    PRE_OPERATIONAL,
)
from axisbus.cia401.signal import Address, IoPoint
from axisbus.cia402.axes import first_axis
from axisbus.errors import BootError, SdoAbort

_STEP = "inputs and outputs"


def prepare(
    objects: NodeObjects, points: Sequence[IoPoint], *, alone: bool, given: Collection[Address] = ()
) -> list[str]:
    """Set error modes, error values and masks of the outputs; return lines that describe the outputs without the master. Blocks.

    ``alone``: the node has no axis, so that its error behaviour may be changed. ``given``: objects that the cell file itself
    writes; a number that the cell file gives for a whole output is not changed.

    Raises:
        BootError: an object is refused, or reads back something else.
    """
    outputs = [point for point in points if point.output]
    behaviour = (o301.ERROR_BEHAVIOR, 1)
    if alone and outputs and read_int(objects, *behaviour) == NO_CHANGE:
        _write(objects, behaviour, PRE_OPERATIONAL)
    return [_prepare(objects, point, given) for point in outputs]


def _prepare(objects: NodeObjects, point: IoPoint, given: Collection[Address]) -> str:
    if (first_axis(point.index), point.subindex) == (DRIVE_OUTPUTS, OUTPUTS):
        _open_mask(objects, point)
        return f"{point.name}: {point.object_text}; the drive's manual says how it reacts without the master"
    row = ERROR_OBJECTS.get(point.index)
    if row is None:
        return f"{point.name}: {point.object_text}; how the module reacts without the master is unknown"
    mode, value = (row.mode, point.subindex), (row.value, point.subindex)
    modes, values = (read_int(objects, *address) for address in (mode, value))
    if modes is None or values is None:
        lacks = f"{row.mode:04X}h and {row.value:04X}h"
        return f"{point.name}: {point.object_text}; the module has no {lacks}, which define its reaction without the master"
    own = not row.by_bit and value in given
    if not own:
        _write(
            objects, value, point.into(values, point.safe)
        )  # before the mode, so that the mode never activates a wrong value
    _write(objects, mode, modes | point.mask if row.by_bit else 1)
    if own:
        return (
            f"{point.name}: {point.object_text}; without the master the module reacts as the cell file writes into "
            f"{_both(value)}"
        )
    return (
        f"{point.name}: {point.object_text}; without the master the module sets it to {point.shown(point.safe):g} "
        f"({_both(mode, value)})"
    )


def _open_mask(objects: NodeObjects, point: IoPoint) -> None:
    """Enable these bits in the drive's output mask; a drive without a mask uses all bits (CiA 402-2, 60FEh).

    A masked bit may hold any value. It gets its safe value first, so that opening a machine switches nothing on.
    """
    mask, word = read_int(objects, point.index, MASK), read_int(objects, *point.address)
    if mask is None or mask & point.mask == point.mask:
        return
    if word is not None:
        _write(objects, point.address, point.into(word, point.safe))
    _write(objects, (point.index, MASK), mask | point.mask)


def _write(objects: NodeObjects, address: Address, value: int) -> None:
    name = f"{address[0]:04X}h:{address[1]:02X}"
    try:
        objects.write_unchecked(*address, value)
        after = read_int(objects, *address)
    except SdoAbort as error:
        raise _failed(objects, address, f"{name} does not accept {value}", error.observed) from error
    if after != value:
        raise _failed(objects, address, f"{name} accepted {value} without an error", f"it reads back {after}")


def _failed(objects: NodeObjects, address: Address, what: str, observed: str) -> BootError:
    return BootError(
        f"node {objects.node_id}: {what}, so its outputs have no safe state without the master",
        node=objects.node_id,
        step=_STEP,
        index=address[0],
        subindex=address[1],
        observed=observed,
        remedy="see the manual of the module for the values of this object; if necessary, remove the output from the cell "
        "file",
    )


def _both(*addresses: Address) -> str:
    return ", ".join(f"{index:04X}h:{sub:02X}" for index, sub in addresses)
