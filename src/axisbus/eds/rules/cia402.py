"""Rules for the objects of a drive: types, access, PDO mapping (CiA 402-2)."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.cia301.objects import DEVICE_TYPE
from axisbus.cia402 import dictionary, options
from axisbus.cia402 import objects as o
from axisbus.cia402.axes import FIRST_AXIS
from axisbus.cia402.dictionary import StandardObject
from axisbus.eds.model import Number, ObjectType, Severity
from axisbus.eds.rules import pdo, standard
from axisbus.eds.rules.cia301 import wrong_object_type
from axisbus.eds.rules.context import Described, Hit, RuleContext, finds
from axisbus.eds.rules.drive import axes

# Defined reactions (CiA 402-2 8.4); negative ones are the maker's.
_REACTIONS = {option.index: option.meanings for option in options.ALL if option.index in FIRST_AXIS}
_COASTING = {  # the value with which the motor coasts
    o.QUICK_STOP_OPTION: "a quick stop",
    o.HALT_OPTION: "a halt",
    o.DISABLE_OPERATION_OPTION: "disabling operation",
    o.FAULT_REACTION_OPTION: "a fault",
}
_RANGES = (0x607B, 0x607D)  # position range limit, software limit: sub-index 1 lower, 2 upper
_NEEDED_ENTRIES = tuple(
    row for row in dictionary.ROWS if row.standard == dictionary.CIA_402 and row.subindex and row.mandatory
)
_TARGETS_BOTH_WAYS = (o.TARGET_POSITION, o.TARGET_VELOCITY, o.TARGET_TORQUE)


@finds("M002")
def data_types(context: RuleContext) -> Iterator[Hit]:
    """M002."""
    for entry, row in _rows(context):
        kind = entry.variable.data_type
        if row.data_types and kind and kind not in row.data_types and _same_shape(context, entry):
            wanted = " or ".join(each.name for each in row.data_types)
            yield context.on(
                entry,
                "datatype",
                f"is {kind.name}, CiA 402 has {wanted} ({row.name})",
                _note_unless_sure(row.sure),
            )


@finds("M003")
def object_types(context: RuleContext) -> Iterator[Hit]:
    """M003."""
    for axis in axes(context):
        for index in context.heads:
            whole = dictionary.whole(index) if axis.owns(index) else None
            if whole is not None:
                wanted = ObjectType[whole.object_type]
                yield from wrong_object_type(context, index, wanted, "CiA 402", _note_unless_sure(whole.sure))


@finds("M004")
def access(context: RuleContext) -> Iterator[Hit]:
    """M004."""
    for entry, row in _rows(context):
        access = entry.variable.access
        if entry.has_access and _same_shape(context, entry) and not standard.access_fits(access, row.access):
            wanted = " or ".join(sorted(row.access))
            text = f"is {access}, CiA 402 has {wanted} ({row.name})"
            yield context.on(entry, "accesstype", text, _note_unless_sure(row.sure))


@finds("M005")
def mappable(context: RuleContext) -> Iterator[Hit]:
    """M005."""
    mapped = {slot.mapped.index for slot in pdo.slots(context)}  # P004 reports these
    for entry, row in _rows(context):
        if row.index not in standard.CYCLIC or row.subindex or entry.variable.pdo_mapping:
            continue
        if _same_shape(context, entry) and entry.variable.index not in mapped:
            yield context.on(entry, "pdomapping", f"cannot be mapped into a PDO ({row.name})")


@finds("M014")
def no_sub_index(context: RuleContext) -> Iterator[Hit]:
    """M014."""
    for axis in axes(context):
        for row in _NEEDED_ENTRIES:
            entry, subindex = context.eds.objects.get(axis.offset + row.index), row.subindex
            if entry is None or not entry.is_record or subindex in entry.subs:
                continue
            if len(entry.subs) > 1:  # without any sub-index, O008 reports it
                head = context.heads.get(entry.index)
                text = f"[{entry.index:04X}] has no sub-index {subindex} ({row.name})"
                yield context.at(head, "", text, entry.index, subindex, _note_unless_sure(row.sure))


@finds("M007")
def profile_number(context: RuleContext) -> Iterator[Hit]:
    """M007."""
    device_type = context.number(DEVICE_TYPE)
    if device_type is None or device_type & 0xFFFF == o.PROFILE_NUMBER or not axes(context):
        return
    text = f"[1000] is 0x{device_type:08X}, but the objects are those of a drive (0x0192 in the low word)"
    yield context.at_start(DEVICE_TYPE, text)


@finds("M015")
def reactions(context: RuleContext) -> Iterator[Hit]:
    """M015."""
    for axis in axes(context):
        for index, known in _REACTIONS.items():
            value = context.number(axis.offset + index)
            if value is not None and value >= 0 and value not in known:
                at = axis.offset + index
                yield context.at_start(at, f"[{at:04X}] is {value}, which CiA 402 does not define")


@finds("M016")
def coasting(context: RuleContext) -> Iterator[Hit]:
    """M016."""
    for axis in axes(context):
        for index, what in _COASTING.items():
            if context.number(axis.offset + index) == 0:
                at = axis.offset + index
                yield context.at_start(at, f"[{at:04X}] is 0: {what} leaves the motor to coast")


@finds("M021")
def crossed_ranges(context: RuleContext) -> Iterator[Hit]:
    """M021."""
    for axis in axes(context):
        for index in _RANGES:
            low, high = (context.number(axis.offset + index, sub) for sub in (1, 2))
            if low is not None and high is not None and low > high:
                at = axis.offset + index
                yield context.at_start(at, f"[{at:04X}sub1] is {low}, above sub-index 2 ({high})", 1)


@finds("M017")
def one_way(context: RuleContext) -> Iterator[Hit]:
    """M017."""
    for axis in axes(context):
        for index in _TARGETS_BOTH_WAYS:
            entry = context.eds.get(axis.offset + index)
            section = context.section_of(axis.offset + index)
            if entry is None or section is None or entry.low is None or not entry.data_type.signed:
                continue
            low = entry.low if isinstance(entry.low, float) else entry.low.value
            if low >= 0:
                high = entry.high.value if isinstance(entry.high, Number) else entry.high
                what = "could not move" if high == 0 else "could move in one direction only"
                text = f"has a LowLimit of {low}: the axis {what} ({entry.name})"
                yield context.on(Described(entry, section), "lowlimit", text)


def _rows(context: RuleContext) -> Iterator[tuple[Described, StandardObject]]:
    """Yield the entries of all axes, each with the row of CiA 402."""
    for axis in axes(context):
        for entry in context.described:
            if axis.owns(entry.variable.index):
                row = standard.row(entry.variable.index, entry.variable.subindex)
                if row is not None:
                    yield entry, row


def _same_shape(context: RuleContext, entry: Described) -> bool:
    """Whether file and standard agree that the object has sub-indices or not; else M003 reports it, and its entries differ."""
    index = entry.variable.index
    whole = dictionary.whole(index)
    return whole is None or (whole.object_type == "VAR") is not context.eds.objects[index].is_record


def _note_unless_sure(sure: bool) -> Severity | None:
    return None if sure else Severity.NOTE
