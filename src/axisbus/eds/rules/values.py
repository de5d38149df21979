"""Rules for values and limits that need more than a single value (DS 306 4.3)."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType
from axisbus.eds.io.values import Default, Limit
from axisbus.eds.model import Number, Variable
from axisbus.eds.rules.context import Described, Hit, Looks, RuleContext, short

_VALUES = {"defaultvalue": "DefaultValue", "parametervalue": "ParameterValue"}
_LIMITS = {"lowlimit": "LowLimit", "highlimit": "HighLimit"}
_NUMBERS = {**_VALUES, **_LIMITS}
_WITHOUT_LIMITS = frozenset(
    (
        *(DataType.VISIBLE_STRING, DataType.OCTET_STRING, DataType.UNICODE_STRING),
        *(DataType.DOMAIN, DataType.TIME_OF_DAY, DataType.TIME_DIFFERENCE),
    )
)
_HIGHEST_NODE_ID = cob.NODE_IDS[-1]
COB_ID_GUARDING = 0x100E  # of DS 301 V3
# Identifiers that depend on the node-ID (CiA 301 7.3.5), by their entry.
NODE_COB_IDS = {
    **{(o.RPDO_COMMUNICATION + number, 1): base for number, base in enumerate(cob.RPDO)},
    **{(o.TPDO_COMMUNICATION + number, 1): base for number, base in enumerate(cob.TPDO)},
    (o.COB_ID_EMCY, 0): cob.EMCY,
    (COB_ID_GUARDING, 0): cob.HEARTBEAT,
}


def beyond_limits(sheet: RuleContext) -> Iterator[Hit]:
    """V003."""
    for entry in sheet.described:
        variable = entry.variable
        if variable.low is None and variable.high is None:
            continue
        for key, value in (("defaultvalue", variable.default), ("parametervalue", variable.parameter_value)):
            crossed = _crossed(value, variable)
            if crossed:
                yield sheet.on(entry, key, f"{_VALUES[key]}={short(entry.text(key))} is {crossed}")


def _crossed(value: Default, variable: Variable) -> str:
    if isinstance(value, (str, bytes)) or value is None:
        return ""
    if _less(value, variable.low):
        return f"below LowLimit={_plain(variable.low)}"
    return f"above HighLimit={_plain(variable.high)}" if _less(variable.high, value) else ""


def _less(left: Limit, right: Limit) -> bool:
    """Whether ``left`` is less for every node-ID."""
    if left is None or right is None:
        return False
    both = _formula(left) and _formula(right)
    most = _plain(left) + (_HIGHEST_NODE_ID if _formula(left) and not both else 0)
    least = _plain(right) + (1 if _formula(right) and not both else 0)
    return most < least


def _formula(value: Number | float) -> bool:
    return isinstance(value, Number) and value.plus_node_id


def _plain(value: Limit) -> float:
    return value.value if isinstance(value, Number) else value or 0.0


def limits_of_texts(sheet: RuleContext) -> Iterator[Hit]:
    """V008."""
    for entry in sheet.described:
        if entry.variable.data_type in _WITHOUT_LIMITS:
            for key, name in _LIMITS.items():
                if entry.text(key):
                    yield sheet.on(entry, key, f"{name} says nothing for {entry.variable.data_type.name}")
                    break


def formula_too_large(sheet: RuleContext) -> Iterator[Hit]:
    """V016."""
    for entry in sheet.described:
        variable = entry.variable
        held = (variable.default, variable.parameter_value, variable.low, variable.high)
        for key, value in zip(_NUMBERS, held, strict=True):
            if not (isinstance(value, Number) and value.plus_node_id and variable.data_type.integer):
                continue
            if value.value + _HIGHEST_NODE_ID > variable.data_type.range[1]:
                text = f"{_NUMBERS[key]}={short(entry.text(key))} exceeds {variable.data_type.name} with node ID 127"
                yield sheet.on(entry, key, text)


def built_in_node_id(sheet: RuleContext) -> Iterator[Hit]:
    """V007."""
    for entry, base, value in _node_cob_ids(sheet):
        identifier = value.value & cob.ID_MASK_11
        node_id = identifier - base
        if not value.plus_node_id and 1 <= node_id <= _HIGHEST_NODE_ID and node_id != sheet.eds.node_id:
            text = f"0x{identifier:X} is $NODEID+0x{base:X} for node {node_id} alone"
            yield sheet.on(entry, "defaultvalue", text)


def no_node_id(sheet: RuleContext) -> Iterator[Hit]:
    """V019."""
    for entry, base, value in _node_cob_ids(sheet):
        if not value.plus_node_id and value.value & cob.ID_MASK_29 == base:
            yield sheet.on(entry, "defaultvalue", f"0x{value.value:X} is meant as $NODEID+0x{value.value:X}")


def _node_cob_ids(sheet: RuleContext) -> Iterator[tuple[Described, int, Number]]:
    """Yield the entries that hold an identifier of the node, with its base and the file's default."""
    for (index, subindex), base in NODE_COB_IDS.items():
        variable = sheet.eds.get(index, subindex)
        section = sheet.section_of(index, subindex)
        if variable is not None and section is not None and isinstance(variable.default, Number):
            yield Described(variable, section), base, variable.default


LOOKS: Looks = {
    "V003": beyond_limits,
    "V007": built_in_node_id,
    "V008": limits_of_texts,
    "V016": formula_too_large,
    "V019": no_node_id,
}
