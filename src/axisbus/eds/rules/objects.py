"""Rules for the sections of single values: keys and names (DS 306 4.6.3.2)."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType
from axisbus.eds.io import values
from axisbus.eds.io.text import Section
from axisbus.eds.io.values import Default, Limit
from axisbus.eds.model import Number, ObjectType, Variable
from axisbus.eds.rules.context import Described, Hit, RuleContext, finds, short
from axisbus.wording import counted

MAX_NAME = 241
_KNOWN_FLAGS = 0b11  # refuse write on download, refuse read on scan (DS 306 4.6.3.3)
_FIRST_OWN_TYPE = 0x40  # smaller numbers are the types of CiA 301 (table 44)
_ACTIONS = (
    0x1010,
    0x1011,
    *range(0x1F50, 0x1F60),
)  # writing these starts an action: store, restore, program
_LIMITS = ("LowLimit", "HighLimit")


@finds("O027")
def shared_names(context: RuleContext) -> Iterator[Hit]:
    """O027."""
    seen: dict[str, int] = {}
    for entry in context.eds:
        head = context.heads.get(entry.index)
        first = seen.setdefault(entry.name.lower(), entry.index)
        if first != entry.index and entry.name and head is not None:
            text = f"[{head.name}] has the name of {first:04X}: {short(entry.name)!r}"
            yield context.at(head, "parametername", text, entry.index)


@finds("O015")
def long_names(context: RuleContext) -> Iterator[Hit]:
    """O015."""
    for section, index, subindex in _all(context):
        name = section.entries.get("parametername", "")
        if len(name) > MAX_NAME:
            text = f"[{section.name}] has a name of {counted(len(name), 'character')}, at most {MAX_NAME} are allowed"
            yield context.at(section, "parametername", text, index, subindex)


@finds("O021")
def empty_names(context: RuleContext) -> Iterator[Hit]:
    """O021."""
    for section, index, subindex in _all(context):
        if section.entries.get("parametername") == "":
            yield context.at(section, "parametername", f"[{section.name}] has an empty name", index, subindex)


@finds("O016")
def mapping_flag(context: RuleContext) -> Iterator[Hit]:
    """O016."""
    for entry in context.described:
        given = entry.text("pdomapping")
        if given not in ("", "0", "1") and values.plain(given) not in (0, 1):
            yield context.on(entry, "pdomapping", f"PDOMapping={short(given)} is neither 0 nor 1")


@finds("O020")
def no_mapping_flag(context: RuleContext) -> Iterator[Hit]:
    """O020."""
    for entry in context.described:
        domain = (
            ObjectType.DOMAIN is entry.variable.object_type or DataType.DOMAIN is entry.variable.data_type
        )
        if "pdomapping" not in entry.section.entries and not domain:
            yield context.on(entry, "", "has no PDOMapping")


@finds("O017")
def record_keys_on_var(context: RuleContext) -> Iterator[Hit]:
    """O017."""
    for entry in context.described:
        for name in ("SubNumber", "CompactSubObj"):
            given = entry.text(name)
            if given and values.plain(given) != 0:
                yield context.on(
                    entry, name, f"{name} does not belong to a {entry.variable.object_type.name}"
                )


@finds("O018")
def domain_keys(context: RuleContext) -> Iterator[Hit]:
    """O018."""
    for entry in context.described:
        if entry.variable.object_type is not ObjectType.DOMAIN:
            continue
        if entry.variable.pdo_mapping:
            yield context.on(entry, "pdomapping", "a DOMAIN cannot be mapped into a PDO")
        for name in _LIMITS:
            if entry.text(name):
                yield context.on(entry, name, f"{name} does not belong to a DOMAIN")


@finds("O019")
def letters_of_access(context: RuleContext) -> Iterator[Hit]:
    """O019."""
    for entry in context.described:
        given = entry.text("accesstype")
        if given != entry.variable.access and given.lower() == entry.variable.access:
            yield context.on(
                entry, "accesstype", f"AccessType={given} is written {given.lower()} in the standard"
            )


@finds("O028")
def unguarded_actions(context: RuleContext) -> Iterator[Hit]:
    """O028."""
    for index in _ACTIONS:
        entry = context.eds.objects.get(index)
        if entry is None:
            continue
        bare = [sub for sub in entry.subs.values() if sub.writable and not sub.object_flags & 1]
        if bare:
            section = context.section_of(index, bare[0].subindex)
            text = f"[{section.name if section else ''}] can be written, and has no ObjFlags with bit 0"
            yield context.at(section, "", text, index, bare[0].subindex)


@finds("O029")
def unknown_flags(context: RuleContext) -> Iterator[Hit]:
    """O029."""
    for entry in context.described:
        if entry.variable.object_flags & ~_KNOWN_FLAGS:
            yield context.on(
                entry, "objflags", f"ObjFlags={short(entry.text('objflags'))} has bits that are reserved"
            )


@finds("O031")
def no_object_type(context: RuleContext) -> Iterator[Hit]:
    """O031."""
    bare = [entry for entry in context.described if not entry.section.entries.get("objecttype")]
    if bare:
        more = f"; so have {counted(len(bare) - 1, 'other')}" if len(bare) > 1 else ""
        yield context.on(bare[0], "", f"has no ObjectType, VAR is meant{more}")


@finds("O032")
def unknown_types(context: RuleContext) -> Iterator[Hit]:
    """O032."""
    for entry in context.described:
        kind = entry.variable.data_type
        if kind >= _FIRST_OWN_TYPE and kind not in context.eds:
            text = f"DataType={short(entry.text('datatype'))} is of no standard, and the file does not describe it"
            yield context.on(entry, "datatype", text)


def _all(context: RuleContext) -> Iterator[tuple[Section, int, int | None]]:
    for index, section in context.heads.items():
        yield section, index, None
    for index, subs in context.subs.items():
        for subindex, section in subs.items():
            yield section, index, subindex


# -- Rules for values and limits that need more than a single value (DS 306 4.3) ---------------------------------------


_NUMBERS = ("DefaultValue", "ParameterValue", *_LIMITS)
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


@finds("V003")
def beyond_limits(context: RuleContext) -> Iterator[Hit]:
    """V003."""
    for entry in context.described:
        variable = entry.variable
        if variable.low is None and variable.high is None:
            continue
        for name, value in (("DefaultValue", variable.default), ("ParameterValue", variable.parameter_value)):
            crossed = _crossed(value, variable)
            if crossed:
                yield context.on(entry, name, f"{name}={short(entry.text(name))} is {crossed}")


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


@finds("V008")
def limits_of_texts(context: RuleContext) -> Iterator[Hit]:
    """V008."""
    for entry in context.described:
        if entry.variable.data_type in _WITHOUT_LIMITS:
            for name in _LIMITS:
                if entry.text(name):
                    yield context.on(entry, name, f"{name} says nothing for {entry.variable.data_type.name}")
                    break


@finds("V016")
def formula_too_large(context: RuleContext) -> Iterator[Hit]:
    """V016."""
    for entry in context.described:
        variable = entry.variable
        held = (variable.default, variable.parameter_value, variable.low, variable.high)
        for name, value in zip(_NUMBERS, held, strict=True):
            if not (isinstance(value, Number) and value.plus_node_id and variable.data_type.integer):
                continue
            if value.value + _HIGHEST_NODE_ID > variable.data_type.range[1]:
                text = f"{name}={short(entry.text(name))} exceeds {variable.data_type.name} with node ID 127"
                yield context.on(entry, name, text)


@finds("V007")
def built_in_node_id(context: RuleContext) -> Iterator[Hit]:
    """V007."""
    for entry, base, value in _node_cob_ids(context):
        identifier = value.value & cob.ID_MASK_11
        node_id = identifier - base
        if not value.plus_node_id and 1 <= node_id <= _HIGHEST_NODE_ID and node_id != context.eds.node_id:
            text = f"0x{identifier:X} is $NODEID+0x{base:X} for node {node_id} alone"
            yield context.on(entry, "defaultvalue", text)


@finds("V019")
def no_node_id(context: RuleContext) -> Iterator[Hit]:
    """V019."""
    for entry, base, value in _node_cob_ids(context):
        if not value.plus_node_id and value.value & cob.ID_MASK_29 == base:
            yield context.on(
                entry, "defaultvalue", f"0x{value.value:X} is meant as $NODEID+0x{value.value:X}"
            )


def _node_cob_ids(context: RuleContext) -> Iterator[tuple[Described, int, Number]]:
    """Yield the entries that hold an identifier of the node, with its base and the file's default."""
    for (index, subindex), base in NODE_COB_IDS.items():
        variable = context.eds.get(index, subindex)
        section = context.section_of(index, subindex)
        if variable is not None and section is not None and isinstance(variable.default, Number):
            yield Described(variable, section), base, variable.default
