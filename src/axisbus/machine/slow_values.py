"""Values of a drive that are not cyclic: temperature, voltage, current, by standard objects or those of the drive plug-in."""

from __future__ import annotations

from axisbus.boot.objects import NodeObjects
from axisbus.cia402.axes import own_index
from axisbus.drives.make import STANDARD_MEASURED, Make, MeasuredObject
from axisbus.eds.model import Eds
from axisbus.errors import StateError


def measure(what: str, objects: NodeObjects, eds: Eds, make: Make, drive_axis: int = 1) -> float:
    """Read ``what`` (``temperature`` in °C, ``voltage`` in V, ``current`` in A) of a drive's axis (from 1); blocks.

    Raises:
        StateError: the object for it is unknown, or the drive does not have it.
        SdoAbort, SdoTimeout: the drive refuses, or does not answer.
    """
    found = make.measured.get(what) or STANDARD_MEASURED.get(what)
    if found is None:
        raise StateError(
            f"node {objects.node_id}: its {what} is not known",
            observed=f"CiA 402 has no object for it, and no object of the manufacturer ({make.name}) is known",
            remedy="read the manufacturer's object: machine.node(ID).sdo[0x2000]",
        )
    _require(found, what, objects, eds, drive_axis)
    value = _read(objects, own_index(found.index, drive_axis), found.subindex) * found.factor
    return value if found.of is None else value * _read(objects, own_index(found.of, drive_axis), 0)


def _require(found: MeasuredObject, what: str, objects: NodeObjects, eds: Eds, drive_axis: int) -> None:
    wanted = [(found.index, found.subindex)] + ([] if found.of is None else [(found.of, 0)])
    for index, subindex in wanted:
        index = own_index(index, drive_axis)
        if eds.get(index, subindex) is None:
            raise StateError(
                f"node {objects.node_id}: it does not report its {what}",
                observed=f"its EDS has no {index:04X}h:{subindex:02X}",
                remedy="if the drive has it, name the drive's own EDS in cell.toml",
            )


def _read(objects: NodeObjects, index: int, subindex: int) -> float:
    value = objects.read(index, subindex)
    assert isinstance(value, (int, float)), f"{index:04X}h:{subindex:02X} is not a number"
    return float(value)
