"""Rules for the parameters of PDOs: types, transmission types and COB-IDs (CiA 301 7.5.2.35, 7.5.2.37)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType
from axisbus.eds.model import Number, Variable
from axisbus.eds.rules.context import Hit, RuleContext, finds, start_value
from axisbus.eds.rules.pdo import MAX_ENTRIES, communications, maps

_PARAMETERS = {
    1: DataType.UNSIGNED32,
    2: DataType.UNSIGNED8,
    3: DataType.UNSIGNED16,
    4: DataType.UNSIGNED8,
    5: DataType.UNSIGNED16,
    6: DataType.UNSIGNED8,
}
_NEEDED = {1: "the COB-ID", 2: "the transmission type"}
_RESERVED_TYPES = {
    True: range(241, 254),
    False: range(241, 252),
}  # by direction: receive, transmit (tables 69, 72)
# Identifiers that no PDO may use (CiA 301 7.3.5).
_RESTRICTED = (
    range(0x080),
    range(0x101, 0x181),
    range(0x581, 0x600),
    range(0x601, 0x680),
    range(0x6E0, 0x700),
    range(0x701, 0x800),
)


@finds("P009")
def parameter_types(context: RuleContext) -> Iterator[Hit]:
    """P009."""
    for _, entry in communications(context):
        for subindex, kind in _PARAMETERS.items():
            sub = entry.subs.get(subindex)
            if sub is not None:
                yield from _type(context, sub, kind)
    for _, entry in maps(context):
        for subindex, sub in entry.subs.items():
            if 1 <= subindex <= MAX_ENTRIES:
                yield from _type(context, sub, DataType.UNSIGNED32)


def standard_type(index: int, subindex: int) -> DataType:
    """Return CiA 301's data type of a sub-index (not 0) of a communication or mapping parameter."""
    mapping = o.is_pdo_mapping(index)
    return DataType.UNSIGNED32 if mapping else _PARAMETERS.get(subindex, DataType.UNSIGNED8)


def _type(context: RuleContext, sub: Variable, kind: DataType) -> Iterator[Hit]:
    if sub.data_type is not kind and sub.data_type:
        section = context.section_of(sub.index, sub.subindex)
        text = f"[{sub.index:04X}sub{sub.subindex:X}] is {sub.data_type.name}, CiA 301 has {kind.name}"
        yield context.at(section, "datatype", text, sub.index, sub.subindex)


@finds("P011")
def missing_parameters(context: RuleContext) -> Iterator[Hit]:
    """P011."""
    for _, entry in communications(context):
        head = context.heads.get(entry.index)
        for subindex, what in _NEEDED.items():
            if subindex not in entry.subs and entry.subs and head is not None:
                text = f"[{entry.index:04X}] has no sub-index {subindex}, {what}"
                yield context.at(head, "", text, entry.index, subindex)


@finds("P012")
def reserved_types(context: RuleContext) -> Iterator[Hit]:
    """P012."""
    for receive, entry in communications(context):
        kind = context.number(entry.index, 2)
        if kind in _RESERVED_TYPES[receive]:
            text = f"[{entry.index:04X}sub2] has transmission type {kind}, which is reserved"
            yield context.at_start(entry.index, text, 2)


@finds("P013")
def restricted_ids(context: RuleContext) -> Iterator[Hit]:
    """P013."""
    for _, sub, value in _valid_cob_ids(context):
        said = restricted(value)
        wrong = f"gives {said}, which CiA 301 keeps for another service" if said else too_long(value)
        if wrong:
            yield context.at_start(sub.index, f"[{sub.index:04X}sub1] {wrong}", 1)


@finds("P014")
def shared_ids(context: RuleContext) -> Iterator[Hit]:
    """P014."""
    seen: dict[tuple[int, bool], int] = {}
    for _, sub, value in _valid_cob_ids(context):
        key = value.value & cob.ID_MASK_29, value.plus_node_id
        first = seen.setdefault(key, sub.index)
        if first != sub.index:
            text = f"[{sub.index:04X}sub1] has the COB-ID of [{first:04X}sub1]"
            yield context.at_start(sub.index, text, 1)


def _valid_cob_ids(context: RuleContext) -> Iterator[tuple[bool, Variable, Number]]:
    """Yield the identifiers of the PDOs that are enabled after power-up, with whether each is an RPDO."""
    for receive, entry in communications(context):
        sub = entry.subs.get(1)
        value = start_value(sub) if sub is not None else None
        if (
            sub is not None
            and value is not None
            and not value.value & cob.INVALID
            and value.value & cob.ID_MASK_29
        ):
            yield receive, sub, value


def restricted(value: Number) -> str:
    """Return the COB-ID that belongs to another service, and the node-IDs that lead to it; empty if there is none."""
    base = value.value & cob.ID_MASK_29
    if not value.plus_node_id:
        return f"the COB-ID 0x{base:X}" if _is_restricted(base) else ""
    nodes = [node for node in cob.NODE_IDS if _is_restricted(base + node)]
    if not nodes:
        return ""
    if len(nodes) == len(cob.NODE_IDS):
        return f"every node ID a COB-ID such as 0x{base + nodes[0]:X} (node 1)"
    ids = f"node ID {nodes[0]}" if len(nodes) == 1 else f"the node IDs {_spans(nodes)}"
    return f"{ids} a COB-ID such as 0x{base + nodes[0]:X}"


def too_long(value: Number) -> str:
    """Return the problem of a COB-ID with bit 29 at 0 that needs more than 11 bits; empty if there is none."""
    identifier = value.value & cob.ID_MASK_29
    highest = identifier + (cob.NODE_IDS[-1] if value.plus_node_id else 0)
    if value.value & cob.EXTENDED or highest <= cob.ID_MASK_11:
        return ""
    return f"gives the COB-ID 0x{highest:X}, which has more than 11 bits, and bit 29 is not set"


def _spans(numbers: Sequence[int]) -> str:
    """Return ascending numbers as ``1 to 3, 7``."""
    starts = [number for number in numbers if number - 1 not in numbers]
    ends = [number for number in numbers if number + 1 not in numbers]
    return ", ".join(
        f"{start}" if start == end else f"{start} to {end}" for start, end in zip(starts, ends, strict=True)
    )


@lru_cache(maxsize=256)
def _is_restricted(identifier: int) -> bool:
    return any(identifier in block for block in _RESTRICTED)
