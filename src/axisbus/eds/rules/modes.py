"""Rules for modes of operation: the objects that each listed mode needs (CiA 402-2, objects 6060h, 6061h, 6502h)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping

from axisbus.cia301.objects import DEVICE_TYPE
from axisbus.cia402 import dictionary
from axisbus.cia402 import objects as o
from axisbus.cia402.homing import METHODS
from axisbus.cia402.modes import FACTS, ModeOfOperation, short
from axisbus.eds.model import Severity
from axisbus.eds.rules.context import Hit, RuleContext, finds, start_key
from axisbus.eds.rules.drive import (
    REQUIRED_OBJECTS,
    TARGETS,
    EdsAxis,
    axes,
    claimed,
    declares_drive,
    meant,
    missing,
    shown,
)
from axisbus.wording import counted

_M = ModeOfOperation
_DEFINED_BITS = sum(1 << facts.supported_bit for facts in FACTS.values())
_RESERVED_BITS = 0xFFFF & ~_DEFINED_BITS  # the high word is the maker's
_MAKER_OR_NONE = 0  # values of 6060h up to this are the maker's, or no mode
# Mandatory in DSP 402 V2 but missing in many later files, or uncertain by public documents.
_USUAL: Mapping[ModeOfOperation, tuple[int, ...]] = {
    _M.PROFILE_POSITION: (o.MOTION_PROFILE_TYPE,),
    _M.PROFILE_VELOCITY: (0x6069, o.VELOCITY_DEMAND),
    _M.PROFILE_TORQUE: (0x6088,),
    _M.INTERPOLATED_POSITION: (o.INTERPOLATION_TIME_PERIOD,),
    _M.CYCLIC_SYNC_POSITION: (o.INTERPOLATION_TIME_PERIOD,),
    _M.CYCLIC_SYNC_VELOCITY: (o.INTERPOLATION_TIME_PERIOD,),
    _M.CYCLIC_SYNC_TORQUE: (o.INTERPOLATION_TIME_PERIOD,),
}
_ONE_OF_SEVERAL = (o.MODES_OF_OPERATION, o.MODES_OF_OPERATION_DISPLAY)
_SINGLE_DEVICE_TYPE = 0x67FF


@finds("M001")
def no_words(context: RuleContext) -> Iterator[Hit]:
    """M001."""
    for axis in axes(context) if declares_drive(context) else ():
        for index in (o.CONTROLWORD, o.STATUSWORD):
            if axis.offset + index not in context.eds:
                entry = context.eds.get(DEVICE_TYPE)
                text = f"the device type is that of a drive, but {_named(axis, index)} is missing"
                key = start_key(entry) if entry is not None else ""
                yield context.at(context.heads.get(DEVICE_TYPE), key, text, axis.offset + index)


@finds("M001c")
def missing_objects(context: RuleContext) -> Iterator[Hit]:
    """M001c."""
    for axis in axes(context):
        modes = claimed(context, axis) or ()
        absent: dict[int, list[ModeOfOperation]] = {}
        for mode in modes:
            for index in missing(context, axis, mode) if meant(context, axis, mode) else ():
                absent.setdefault(index, []).append(mode)
        for index, needing in absent.items():
            text = f"{_claims(context, axis, needing)}, but {_named(axis, index)} is missing"
            yield _at_claim(context, axis, text, index, _note_unless_sure(index))
        for index in _ONE_OF_SEVERAL if len(modes) > 1 else ():
            if axis.offset + index not in context.eds:
                text = f"6502 claims {counted(len(modes), 'mode')}, but {_named(axis, index)} is missing"
                yield _at_claim(context, axis, text, index)


@finds("M008")
def empty_claims(context: RuleContext) -> Iterator[Hit]:
    """M008."""
    for axis in axes(context):
        for mode in claimed(context, axis) or ():
            if not meant(context, axis, mode):
                absent = ", ".join(_named(axis, index) for index in missing(context, axis, mode))
                text = f"{_claims(context, axis, [mode])}, without any object; {absent} would be needed"
                yield _at_claim(context, axis, text)


@finds("M009")
def unclaimed(context: RuleContext) -> Iterator[Hit]:
    """M009."""
    for axis in axes(context):
        modes = claimed(context, axis)
        others = [mode for mode in shown(context, axis) if modes is not None and mode not in modes]
        if others:
            names = ", ".join(short(mode) for mode in others)
            text = (
                f"{_word(context, axis)} does not claim {names}, though all mandatory objects are described"
            )
            yield _at_claim(context, axis, text)


@finds("M006")
def no_supported_modes(context: RuleContext) -> Iterator[Hit]:
    """M006."""
    for axis in axes(context):
        index = axis.offset + o.SUPPORTED_DRIVE_MODES
        section = context.section_of(index)
        if claimed(context, axis) is not None or (
            section is not None and section.entries.get("defaultvalue")
        ):
            continue  # a default that is no number is V001
        there = index in context.eds
        names = ", ".join(short(mode) for mode in shown(context, axis)) or "no mode"
        what = "has no default" if there else "is missing"
        text = f"6502 on axis {axis.number} {what}: which modes there are is open; the objects show {names}"
        yield context.at(section or context.where_missing(index), "", text, index)


@finds("M018")
def half_a_mode(context: RuleContext) -> Iterator[Hit]:
    """M018."""
    for axis in axes(context):
        for mode, own in REQUIRED_OBJECTS.items() if claimed(context, axis) is None else ():
            there = [index for index in own if axis.offset + index in context.eds]
            absent = missing(context, axis, mode)
            if there and absent:
                names = ", ".join(_named(axis, index) for index in absent)
                first = axis.offset + there[0]
                text = f"{_named(axis, there[0])} belongs to {short(mode)}, for which {names} would be needed too"
                yield context.at(context.heads.get(first), "", text, first)
        yield from _lonely_targets(context, axis) if claimed(context, axis) is None else ()


def _lonely_targets(context: RuleContext, axis: EdsAxis) -> Iterator[Hit]:
    """Yield a hit for each target without a complete mode, unless another object of one of its modes is reported."""
    for target, modes in TARGETS.items():
        there = axis.offset + target
        lacking = {mode: missing(context, axis, mode) for mode in modes}
        has_required = any(
            axis.offset + index in context.eds for mode in modes for index in REQUIRED_OBJECTS.get(mode, ())
        )
        if there in context.eds and all(lacking.values()) and not has_required:
            needed = "; ".join(
                f"{short(mode)} would need {', '.join(_named(axis, index) for index in absent)} too"
                for mode, absent in lacking.items()
            )
            yield context.at(
                context.heads.get(there), "", f"{_named(axis, target)} is there, but {needed}", there
            )


@finds("M010")
def reserved_bits(context: RuleContext) -> Iterator[Hit]:
    """M010."""
    for axis in axes(context):
        word = context.number(axis.offset + o.SUPPORTED_DRIVE_MODES) or 0
        if word & _RESERVED_BITS:
            yield _at_claim(
                context, axis, f"{_word(context, axis)} has reserved bits: 0x{word & _RESERVED_BITS:04X}"
            )


@finds("M011")
def unsupported_default(context: RuleContext) -> Iterator[Hit]:
    """M011."""
    for axis in axes(context):
        modes = claimed(context, axis)
        for index in _ONE_OF_SEVERAL:
            value = context.number(axis.offset + index)
            if value is None or value <= _MAKER_OR_NONE:
                continue
            wrong = _wrong_mode(context, axis, _M(value), modes)
            if not wrong:
                continue
            text = f"[{axis.offset + index:04X}] begins in {short(_M(value))}, {wrong}"
            yield context.at_start(axis.offset + index, text)


def _wrong_mode(
    context: RuleContext, axis: EdsAxis, mode: ModeOfOperation, claimed: Collection[ModeOfOperation] | None
) -> str:
    """Return the reason why a drive cannot start in a mode, empty if it can."""
    if mode not in FACTS:
        return "a mode that CiA 402 does not have"
    if claimed is not None:
        return "" if mode in claimed else f"which {_word(context, axis)} does not claim"
    return "" if meant(context, axis, mode) else "without any object"


@finds("M020")
def no_mode_display(context: RuleContext) -> Iterator[Hit]:
    """M020."""
    for axis in axes(context):
        mode, display = (axis.offset + index for index in _ONE_OF_SEVERAL)
        reported = len(claimed(context, axis) or ()) > 1  # M001c reports it
        if mode in context.eds and display not in context.eds and not reported:
            here, there = (_named(axis, index) for index in _ONE_OF_SEVERAL)
            yield context.at(context.heads.get(mode), "", f"{here} is there without {there}", display)


@finds("M019")
def homing_methods(context: RuleContext) -> Iterator[Hit]:
    """M019."""
    for axis in axes(context):
        index = axis.offset + o.HOMING_METHOD
        method = context.number(index)
        if method is not None and method > 0 and method not in METHODS:
            yield context.at_start(
                index, f"[{index:04X}] is {method}, which is not a homing method of CiA 402"
            )


@finds("M012")
def usual_objects(context: RuleContext) -> Iterator[Hit]:
    """M012."""
    for axis in axes(context):
        absent: dict[int, list[ModeOfOperation]] = {}
        for mode in claimed(context, axis) or ():
            for index in _USUAL.get(mode, ()):
                if axis.offset + index not in context.eds and meant(context, axis, mode):
                    absent.setdefault(index, []).append(mode)
        for index, needing in absent.items():
            text = (
                f"{_claims(context, axis, needing)}; {_named(axis, index)}, which belongs to it, is missing"
            )
            yield _at_claim(context, axis, text, index)


@finds("M013")
def no_axis_type(context: RuleContext) -> Iterator[Hit]:
    """M013."""
    found = axes(context)
    for axis in found if len(found) > 1 else ():
        index = axis.offset + _SINGLE_DEVICE_TYPE
        if index not in context.eds:
            text = f"the device has {counted(len(found), 'axis', 'axes')}, but {index:04X} (Single device type) is missing"
            yield context.at(context.where_missing(index), "", text, index)


def _claims(context: RuleContext, axis: EdsAxis, modes: Iterable[ModeOfOperation]) -> str:
    return f"{_word(context, axis)} claims {', '.join(short(mode) for mode in modes)}"


def _word(context: RuleContext, axis: EdsAxis) -> str:
    index = axis.offset + o.SUPPORTED_DRIVE_MODES
    word = context.number(index)
    return f"{index:04X} (0x{word or 0:X})"


def _named(axis: EdsAxis, index: int) -> str:
    name = dictionary.name(index)
    return f"{axis.offset + index:04X}" + (f" ({name})" if name else "")


def _note_unless_sure(index: int) -> Severity | None:
    """Return NOTE for an object that is not certainly mandatory, else None (the rule's own severity)."""
    whole = dictionary.whole(index)
    return None if whole is not None and whole.sure else Severity.NOTE


def _at_claim(
    context: RuleContext,
    axis: EdsAxis,
    message: str,
    index: int | None = None,
    severity: Severity | None = None,
) -> Hit:
    """Return a hit at the value of 6502h; ``index`` (on the first axis) is the missing object."""
    absent = None if index is None else axis.offset + index
    word = axis.offset + o.SUPPORTED_DRIVE_MODES
    return context.at_start(word, message, missing=absent, severity=severity)
