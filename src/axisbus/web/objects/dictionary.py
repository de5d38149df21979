"""A node's object dictionary from its EDS, as plain values for the page, with the permitted access of each object."""

from __future__ import annotations

from axisbus.bus.node.verify import is_domain, may_read
from axisbus.cell.quantities import Quantities
from axisbus.configuration import guarded_write
from axisbus.eds.model import Object, Variable
from axisbus.eds.report import wording
from axisbus.eds.report.show import DIRECTIONS
from axisbus.machine.machine_node import MachineNode
from axisbus.web.objects.key import ObjectKey
from axisbus.web.view.axes import Values

_MOVES = "can energise or move the drive: only for the commands of its axis"
_CYCLIC = "is sent by PDO in every cycle"


def tree(node: MachineNode, quantities: Quantities) -> list[Values]:
    """Return the objects in the order of their indices, each with its entries."""
    return [_object(node, quantities, each) for each in node.eds or ()]


def _object(node: MachineNode, quantities: Quantities, each: Object) -> Values:
    entries = [_entry(node, quantities, sub) for sub in each.subs.values()]
    return {
        "index": f"{each.index:04X}",
        "name": each.denotation or each.name,
        "kind": each.object_type.name,
        "record": each.is_record,
        "entries": entries,
    }


def _entry(node: MachineNode, quantities: Quantities, sub: Variable) -> Values:
    node_id = node.node_id
    quantity = quantities.of(node_id, sub.index, sub.subindex)
    return {
        "key": str(ObjectKey(node_id, sub.index, sub.subindex)),
        "sub": f"{sub.subindex:02X}",
        "name": sub.denotation or sub.name,
        "type": wording.type_name(sub),
        "access": sub.access,
        "pdo": DIRECTIONS.get(wording.pdo_direction(sub), ""),
        "default": wording.initial(sub, node_id),
        "limits": wording.limits(sub, node_id, whole=True),
        "carried": _carried(node, sub),
        "unit": "" if quantity is None else quantity.unit,
        "reads": sub.readable and may_read(sub),
        "writes": sub.writable and not is_domain(sub),
        "notes": _notes(node, sub),
    }


def _carried(node: MachineNode, sub: Variable) -> str:
    carried = node.access.mapped_in(sub.index, sub.subindex)
    return "" if carried is None else f"{carried.pdo} ({carried.can_id:03X}h)"


def _notes(node: MachineNode, sub: Variable) -> list[str]:
    """Return why an object that is writable by its EDS should not be written by hand."""
    found = [_CYCLIC] if (sub.index, sub.subindex) in node.access.sdo.cyclic else []
    entry = node.sdo.dictionary.entry(sub.index, sub.subindex)
    if sub.writable and guarded_write.moves(node.eds, entry):
        found.append(_MOVES)
    return found
