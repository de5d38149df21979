"""Rules for the identifiers of SYNC, TIME, EMCY, node guarding and SDO (CiA 301 7.3.5, 7.5.2)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType
from axisbus.eds.model import Number, Variable
from axisbus.eds.rules.context import Hit, Looks, RuleContext, start_key, start_value
from axisbus.eds.rules.objects import COB_ID_GUARDING
from axisbus.eds.rules.pdo_parameters import restricted, too_long

SDO_PARAMETERS = range(0x1200, 0x1300)
SDO_TYPES = {1: DataType.UNSIGNED32, 2: DataType.UNSIGNED32, 3: DataType.UNSIGNED8}
_SDO_NEEDED = {1: "the COB-ID from client to server", 2: "the COB-ID from server to client"}
_HIGHEST_NODE_ID = cob.NODE_IDS[-1]


class _Service(NamedTuple):
    """A service by name, and the identifier to which the node-ID is added; None if all nodes share one identifier."""

    name: str
    base: int | None = None


_SERVICES: Mapping[int, _Service] = {
    o.COB_ID_SYNC: _Service("SYNC"),
    o.COB_ID_TIME: _Service("TIME"),
    o.COB_ID_EMCY: _Service("EMCY", cob.EMCY),
    COB_ID_GUARDING: _Service("node guarding", cob.HEARTBEAT),
}


def identifiers(sheet: RuleContext) -> Iterator[Hit]:
    """C016."""
    for index, service in _SERVICES.items():
        entry = sheet.eds.get(index)
        value = start_value(entry) if entry is not None else None
        if entry is None or value is None or (index == o.COB_ID_EMCY and value.value & cob.INVALID):
            continue
        wrong = too_long(value) or _wrong(service, value)
        if wrong:
            section = sheet.section_of(index)
            yield sheet.at(section, start_key(entry), f"[{index:04X}] {wrong}", index)


def _wrong(service: _Service, value: Number) -> str:
    if service.base is None:
        return _wrong_of_all(service, value)
    if not value.plus_node_id:
        node = (value.value & cob.ID_MASK_29) - service.base
        if 0 <= node <= _HIGHEST_NODE_ID:
            return ""  # V007 and V019 report it
        return f"has no $NODEID: every node would use 0x{value.value & cob.ID_MASK_29:X} for {service.name}"
    if service.base == cob.HEARTBEAT:
        right = value.value & cob.ID_MASK_29 == service.base
        return "" if right else f"is not $NODEID+0x{service.base:X}, the identifier of {service.name}"
    said = restricted(value)
    return f"gives {said}, which CiA 301 keeps for another service" if said else ""


def _wrong_of_all(service: _Service, value: Number) -> str:
    if value.plus_node_id:
        return f"depends on the node ID, but {service.name} has one identifier for all nodes"
    if not value.value & cob.ID_MASK_29:
        return f"is 0x{value.value:X}, without an identifier for {service.name}"
    said = restricted(value)
    return f"gives {said}, which CiA 301 keeps for another service" if said else ""


def sdo_types(sheet: RuleContext) -> Iterator[Hit]:
    """C003, for the SDO parameters."""
    for sub in _sdo_entries(sheet):
        kind = SDO_TYPES.get(sub.subindex, sub.data_type)
        if sub.data_type and sub.data_type is not kind:
            text = f"[{sub.index:04X}sub{sub.subindex:X}] is {sub.data_type.name}, CiA 301 has {kind.name}"
            section = sheet.section_of(sub.index, sub.subindex)
            yield sheet.at(section, "datatype", text, sub.index, sub.subindex)


def _sdo_entries(sheet: RuleContext) -> Iterator[Variable]:
    for index, entry in sheet.eds.objects.items():
        if index in SDO_PARAMETERS and entry.is_record:
            yield from entry.subs.values()


def sdo_without_ids(sheet: RuleContext) -> Iterator[Hit]:
    """C017."""
    for index, entry in sheet.eds.objects.items():
        if index not in SDO_PARAMETERS or not entry.is_record or len(entry.subs) < 2:
            continue  # without any sub-index, O008 reports it
        for subindex, what in _SDO_NEEDED.items():
            if subindex not in entry.subs:
                text = f"[{index:04X}] has no sub-index {subindex}, {what}"
                yield sheet.at(sheet.heads.get(index), "", text, index, subindex)


LOOKS: Looks = {"C016": identifiers, "C017": sdo_without_ids}
