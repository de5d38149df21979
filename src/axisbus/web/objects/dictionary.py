"""A node's object dictionary from its EDS, as plain values for the page, with the permitted access of each object."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterable
from pathlib import Path

from axisbus.bus.node.verify import is_domain, may_read
from axisbus.bus.pdo.plan import PdoChange, PdoPlan
from axisbus.cell.quantities import Quantities
from axisbus.client_support.object_access import node_of
from axisbus.configuration import guarded_write
from axisbus.core.node_access_parts import NodeParts
from axisbus.eds import checking, layout
from axisbus.eds.layout import PdoLayout, PdoSlot
from axisbus.eds.model import Eds, EdsFinding, Object, Variable
from axisbus.eds.report import pdo_text, wording
from axisbus.eds.report.show import DIRECTIONS
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode
from axisbus.web.objects.transfer_queue import ObjectKey
from axisbus.web.view import Values, explained

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
        "carried": _mapped_in(node, sub),
        "unit": "" if quantity is None else quantity.unit,
        "reads": sub.readable and may_read(sub),
        "writes": sub.writable and not is_domain(sub),
        "notes": _notes(node, sub),
    }


def _mapped_in(node: MachineNode, sub: Variable) -> str:
    mapped = node.access.mapped_in(sub.index, sub.subindex)
    return "" if mapped is None else f"{mapped.pdo} ({mapped.can_id:03X}h)"


def _notes(node: MachineNode, sub: Variable) -> list[str]:
    """Return why an object that is writable by its EDS should not be written by hand."""
    found = [_CYCLIC] if (sub.index, sub.subindex) in node.access.sdo.cyclic else []
    entry = node.sdo.dictionary.entry(sub.index, sub.subindex)
    if sub.writable and guarded_write.moves(node.eds, entry):
        found.append(_MOVES)
    return found


# -- The findings of ``axisbus eds check`` for the EDS of a node, as plain values; worst first -------------------------


MAX_FINDINGS = 300


def findings(eds: Eds) -> Values:
    """Return the findings, their total number, and the error if the file could not be checked; may take a second."""
    try:
        found = sorted(checking.check(eds), key=lambda each: each.severity.rank)
    except AxisbusError as error:
        return {"all": 0, "shown": [], "error": explained(error)}
    return {"all": len(found), "shown": [_finding(each) for each in found[:MAX_FINDINGS]], "error": None}


def _finding(each: EdsFinding) -> Values:
    where = "" if each.index is None else f"{each.index:04X}"
    return {
        "severity": each.severity.value,
        "rule": each.rule,
        "line": each.line,
        "index": where,
        "message": each.message,
        "remedy": each.remedy,
    }


# -- The PDOs of a node as layouts of bytes: those in use as configured in the drive, all others as in its EDS ---------


_IN_USE = "in use, as mapped in the drive"
_OFF = "disabled by the core: other PDOs carry the same objects"
_BY_EDS = "by the EDS: the core does not use it"


def layouts(eds: Eds, node_id: int, plans: Iterable[PdoPlan]) -> list[Values]:
    """Return every PDO that the plans of a node use or its EDS describes, RPDOs first."""
    found = {(each.receive, each.number): (each, _BY_EDS) for each in layout.layouts(eds, node_id)}
    planned = [pdo for plan in plans for pdo in plan.pdos]
    for pdo in sorted(
        planned, key=lambda pdo: pdo.change is not PdoChange.DISABLE
    ):  # a PDO that one axis uses is in use
        source = _OFF if pdo.change is PdoChange.DISABLE else _IN_USE
        found[pdo.receive, pdo.target.number] = layout.of_pdo(eds, pdo.target, receive=pdo.receive), source
    return [_pdo(*found[key]) for key in sorted(found, key=lambda key: (not key[0], key[1]))]


def _pdo(each: PdoLayout, source: str) -> Values:
    return {
        "name": each.name,
        "source": source,
        "used": source == _IN_USE,
        "heading": pdo_text.heading(each),
        "size": each.size,
        "slots": [_slot(slot) for slot in each.slots],
        "notes": list(each.notes),
    }


def _slot(slot: PdoSlot) -> Values:
    return {
        "first": slot.first_bit,
        "bits": slot.bits,
        "where": slot.where,
        "address": slot.address,
        "name": slot.name or "(not described)",
        "type": pdo_text.kind(slot),
    }


# ----------------------------------------------------------------------------------------------------------------------
# The object dictionary of each node from its EDS, as a page fetches it: made once for all pages, without asking the node.


class DictionaryCache:
    """Cache the dictionary of each node for as long as its parts stay the same; used by one event loop."""

    def __init__(self, machine: Machine) -> None:
        """Make no dictionary before it is requested."""
        self._machine = machine
        self._cache: dict[int, tuple[NodeParts, bytes]] = {}
        self._lock = asyncio.Lock()

    async def page(self, node_id: int) -> bytes:
        """Return the dictionary, the PDOs and the findings of a node as JSON, or why there is none."""
        async with self._lock:  # fifty simultaneous requests must make it only once
            try:
                return await self._page(node_id)
            except AxisbusError as error:
                return json.dumps({"node": node_id, "error": explained(error)}).encode()

    async def _page(self, node_id: int) -> bytes:
        parts = node_of(self._machine, node_id).access.parts
        cached = self._cache.get(node_id)
        if cached is None or cached[0] is not parts:  # a node that joined late has new parts
            content = await asyncio.to_thread(dictionary_values, self._machine, node_id)
            self._cache[node_id] = cached = parts, json.dumps(content).encode()
        return cached[1]


def dictionary_values(machine: Machine, node_id: int) -> Values:
    """Return the dictionary of a node as plain values; may take a second.

    Raises:
        StateError: as ``node_of``.
    """
    node = node_of(machine, node_id)
    assert node.eds is not None
    return {
        "node": node_id,
        "file": Path(node.eds.source).name,
        "objects": tree(node, Quantities(machine.cell)),
        "pdos": layouts(node.eds, node_id, node.access.plans),
        "findings": findings(node.eds),
        "error": None,
    }
