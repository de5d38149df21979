"""The PDOs of a node as layouts of bytes: those in use as configured in the drive, all others as in its EDS."""

from __future__ import annotations

from collections.abc import Iterable

from axisbus.bus.pdo.plan import PdoChange, PdoPlan
from axisbus.eds import layout
from axisbus.eds.layout import PdoLayout, PdoSlot
from axisbus.eds.model import Eds
from axisbus.eds.report import pdo_text
from axisbus.web.view.axes import Values

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
