"""Rules for the communication objects (CiA 301 7.5.2)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.pdo import is_synchronous
from axisbus.cia402 import dictionary
from axisbus.cia402.dictionary import StandardObject
from axisbus.eds.model import Number, ObjectType, Severity, Variable
from axisbus.eds.rules import pdo, standard
from axisbus.eds.rules.context import Described, Hit, RuleContext, an, finds, number_of, start_value
from axisbus.eds.rules.objects import COB_ID_GUARDING
from axisbus.eds.rules.pdo_parameters import restricted, too_long

_AREA = range(0x1000, 0x1030)
_SYNC_PRODUCER = 1 << 30
_OVERFLOW = 0x1019
_STORE_EDS, _STORE_FORMAT = 0x1021, 0x1022
_SDO_SERVER = 0x1200
_SDO_IDS = {1: cob.SDO_RX, 2: cob.SDO_TX}
_RECORDS = (
    range(0x1280, 0x1300),
    range(0x1400, 0x1600),
    range(0x1600, 0x1800),
    range(0x1800, 0x1A00),
    range(0x1A00, 0x1C00),
)


@finds("C001")
def no_mandatory(context: RuleContext) -> Iterator[Hit]:
    """C001."""
    for index in (o.DEVICE_TYPE, o.ERROR_REGISTER):
        if index not in context.eds:
            yield context.at(context.where_missing(index), "", f"object {_named(index)} is missing", index)


@finds("C008")
def no_identity(context: RuleContext) -> Iterator[Hit]:
    """C008."""
    if o.IDENTITY not in context.eds:
        yield context.at(
            context.where_missing(o.IDENTITY), "", f"object {_named(o.IDENTITY)} is missing", o.IDENTITY
        )
    elif context.eds.get(o.IDENTITY, 1) is None and context.eds.objects[o.IDENTITY].subs:
        yield context.at(
            context.heads.get(o.IDENTITY), "", "[1018] has no sub-index 1, the vendor-ID", o.IDENTITY, 1
        )


@finds("C002")
def object_types(context: RuleContext) -> Iterator[Hit]:
    """C002."""
    for index in context.heads:
        whole = dictionary.whole(index) if index in _AREA or index == _SDO_SERVER else None
        if whole is not None:
            yield from wrong_object_type(context, index, ObjectType[whole.object_type], "CiA 301")


def wrong_object_type(
    context: RuleContext, index: int, wanted: ObjectType, standard_name: str, severity: Severity | None = None
) -> Iterator[Hit]:
    """Yield a hit if an object's type differs from the standard's."""
    entry, head = context.eds.objects[index], context.heads[index]
    if not head.entries.get("objecttype"):
        return  # an assumed type is not the file's mistake; O006 and O031 report it
    if entry.object_type is not wanted and not (
        wanted is ObjectType.VAR and entry.object_type is ObjectType.DOMAIN
    ):
        text = f"[{head.name}] is {an(entry.object_type)}, {standard_name} has {an(wanted)}"
        yield context.at(head, "objecttype", text, index, severity=severity)


@finds("C020")
def pdo_object_types(context: RuleContext) -> Iterator[Hit]:
    """C020."""
    for index in context.heads:
        if any(index in area for area in _RECORDS):
            yield from wrong_object_type(context, index, ObjectType.RECORD, "CiA 301")


@finds("C003")
def data_types(context: RuleContext) -> Iterator[Hit]:
    """C003."""
    for entry, row in _rows(context):
        kind = entry.variable.data_type
        if row.data_types and kind and kind not in row.data_types:
            wanted = " or ".join(each.name for each in row.data_types)
            yield context.on(entry, "datatype", f"is {kind.name}, CiA 301 has {wanted} ({row.name})")
    yield from sdo_types(context)


@finds("C004")
def access(context: RuleContext) -> Iterator[Hit]:
    """C004."""
    for entry, row in _rows(context):
        if entry.has_access and row.access and row.access <= standard.READ_ONLY and entry.variable.writable:
            wanted = " or ".join(sorted(row.access))
            yield context.on(
                entry, "accesstype", f"is {entry.variable.access}, CiA 301 has {wanted} ({row.name})"
            )


@finds("C021")
def fixed(context: RuleContext) -> Iterator[Hit]:
    """C021."""
    for entry, row in _rows(context):
        if row.access == {"rw"} and entry.has_access and not entry.variable.writable:
            yield context.on(entry, "accesstype", f"is {entry.variable.access}, CiA 301 has rw ({row.name})")


def _rows(context: RuleContext) -> Iterator[tuple[Described, StandardObject]]:
    for entry in context.described:
        variable = entry.variable
        if variable.index > _SDO_SERVER:
            break
        row = standard.row(variable.index, variable.subindex) if variable.index in _AREA else None
        if row is not None:
            yield entry, row


@finds("C005")
def no_device_type(context: RuleContext) -> Iterator[Hit]:
    """C005."""
    head = context.heads.get(o.DEVICE_TYPE)
    if head is not None and not head.entries.get("defaultvalue") and context.number(o.DEVICE_TYPE) is None:
        yield context.at(head, "defaultvalue", f"[{head.name}] has no DefaultValue", o.DEVICE_TYPE)


@finds("C006")
def no_error_control(context: RuleContext) -> Iterator[Hit]:
    """C006."""
    guarding = o.GUARD_TIME in context.eds and o.LIFE_TIME_FACTOR in context.eds
    if o.PRODUCER_HEARTBEAT not in context.eds and not guarding:
        text = "neither the heartbeat (1017) nor node guarding (100C and 100D) is described"
        yield context.at(context.where_missing(o.PRODUCER_HEARTBEAT), "", text, o.PRODUCER_HEARTBEAT)


@finds("C007")
def no_emergency_id(context: RuleContext) -> Iterator[Hit]:
    """C007."""
    if o.PREDEFINED_ERROR_FIELD in context.eds and o.COB_ID_EMCY not in context.eds:
        head = context.heads.get(o.PREDEFINED_ERROR_FIELD)
        yield context.at(
            head, "", "errors are kept (1003), but 1014, the COB-ID of EMCY, is missing", o.COB_ID_EMCY
        )


@finds("C009")
def no_sync_id(context: RuleContext) -> Iterator[Hit]:
    """C009."""
    if o.COB_ID_SYNC in context.eds:
        return
    for _, entry in pdo.communications(context):
        sub = entry.subs.get(2)
        kind = number_of(sub) if sub is not None else None
        if sub is not None and kind is not None and is_synchronous(kind) and _exists(context, entry.index):
            text = f"[{entry.index:04X}sub2] is synchronous (type {kind}), but 1005, the COB-ID of SYNC, is missing"
            yield context.at_start(entry.index, text, 2, missing=o.COB_ID_SYNC)
            return


def _exists(context: RuleContext, index: int) -> bool:
    identifier = context.number(index, 1)
    return identifier is not None and not identifier & cob.INVALID


@finds("C010")
def no_cycle_period(context: RuleContext) -> Iterator[Hit]:
    """C010."""
    sync = context.number(o.COB_ID_SYNC)
    if sync is not None and sync & _SYNC_PRODUCER and o.CYCLE_PERIOD not in context.eds:
        text = "the device produces SYNC (bit 30 of 1005), but 1006, the cycle period, is missing"
        yield context.at(context.heads.get(o.COB_ID_SYNC), "defaultvalue", text, o.CYCLE_PERIOD)


@finds("C011")
def half_a_guard(context: RuleContext) -> Iterator[Hit]:
    """C011."""
    for here, there in ((o.GUARD_TIME, o.LIFE_TIME_FACTOR), (o.LIFE_TIME_FACTOR, o.GUARD_TIME)):
        if here in context.eds and there not in context.eds:
            text = f"{_named(here)} is there without {_named(there)}"
            yield context.at(context.heads.get(here), "", text, there)


@finds("C012")
def sdo_ids(context: RuleContext) -> Iterator[Hit]:
    """C012."""
    for subindex, base in _SDO_IDS.items():
        entry = context.eds.get(_SDO_SERVER, subindex)
        value = start_value(entry) if entry is not None else None
        if value is None:
            continue
        given = value.value
        right = given == base if value.plus_node_id else base < given <= base + 127
        if not right and value.value:
            text = f"[1200sub{subindex}] is not $NODEID+0x{base:X}, the identifier of the default SDO"
            yield context.at_start(_SDO_SERVER, text, subindex)


@finds("C013")
def emergency_id(context: RuleContext) -> Iterator[Hit]:
    """C013."""
    entry = context.eds.get(o.COB_ID_EMCY)
    value = start_value(entry) if entry is not None else None
    if value is None or value.value & cob.INVALID:
        return
    base = value.value & cob.ID_MASK_29
    if value.plus_node_id and base != cob.EMCY and not restricted(value):  # else C016 reports it
        text = f"[1014] is $NODEID+0x{base:X}, $NODEID+0x80 is the identifier of EMCY"
        yield context.at_start(o.COB_ID_EMCY, text)


@finds("C014")
def sync_overflow(context: RuleContext) -> Iterator[Hit]:
    """C014."""
    value = context.number(_OVERFLOW)
    if value is not None and value != 0 and not 2 <= value <= 240:
        yield context.at_start(_OVERFLOW, f"[1019] is {value}, the allowed values are 0 and 2 to 240")


@finds("C015")
def no_store_format(context: RuleContext) -> Iterator[Hit]:
    """C015."""
    if _STORE_EDS in context.eds and _STORE_FORMAT not in context.eds:
        text = "1021, the stored EDS, is there without 1022, its format"
        yield context.at(context.heads.get(_STORE_EDS), "", text, _STORE_FORMAT)


def _named(index: int) -> str:
    name = dictionary.name(index)
    return f"{index:04X} ({name})" if name else f"{index:04X}"


# -- The identifiers of SYNC, TIME, EMCY, node guarding and SDO (CiA 301 7.3.5, 7.5.2) -------------------------------------

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


@finds("C016")
def identifiers(context: RuleContext) -> Iterator[Hit]:
    """C016."""
    for index, service in _SERVICES.items():
        entry = context.eds.get(index)
        value = start_value(entry) if entry is not None else None
        if value is None or (index == o.COB_ID_EMCY and value.value & cob.INVALID):
            continue
        wrong = too_long(value) or _wrong(service, value)
        if wrong:
            yield context.at_start(index, f"[{index:04X}] {wrong}")


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


def sdo_types(context: RuleContext) -> Iterator[Hit]:
    """Yield the hits of C003 for the SDO parameters."""
    for sub in _sdo_entries(context):
        kind = SDO_TYPES.get(sub.subindex, sub.data_type)
        if sub.data_type and sub.data_type is not kind:
            text = f"[{sub.index:04X}sub{sub.subindex:X}] is {sub.data_type.name}, CiA 301 has {kind.name}"
            section = context.section_of(sub.index, sub.subindex)
            yield context.at(section, "datatype", text, sub.index, sub.subindex)


def _sdo_entries(context: RuleContext) -> Iterator[Variable]:
    for index, entry in context.eds.objects.items():
        if index in SDO_PARAMETERS and entry.is_record:
            yield from entry.subs.values()


@finds("C017")
def sdo_without_ids(context: RuleContext) -> Iterator[Hit]:
    """C017."""
    for index, entry in context.eds.objects.items():
        if index not in SDO_PARAMETERS or not entry.is_record or len(entry.subs) < 2:
            continue  # without any sub-index, O008 reports it
        for subindex, what in _SDO_NEEDED.items():
            if subindex not in entry.subs:
                text = f"[{index:04X}] has no sub-index {subindex}, {what}"
                yield context.at(context.heads.get(index), "", text, index, subindex)
