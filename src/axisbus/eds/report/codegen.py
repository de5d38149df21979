"""A Python module made from an EDS: a constant for each entry, and the enumerations of CiA 402 that the device uses.

Theory of operation. The text depends only on the model and the node-ID, so that the same file gives the same bytes. Names come from
the file, made unique by the address (``naming``). Each row of a table is one line, however long: the module turns formatters off.
It imports only the standard library, and passes ``mypy --strict`` and ruff.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import PurePath

from axisbus.cia402 import controlword, modes, options, statusword
from axisbus.cia402 import objects as cia402
from axisbus.cia402.axes import first_axis
from axisbus.cia402.controlword import PowerCommand
from axisbus.cia402.modes import ModeOfOperation
from axisbus.eds.model import Eds, Number, Object, Variable
from axisbus.eds.report import naming, overview, wording

_HEAD = """
# ruff: noqa: E501, RUF100
from __future__ import annotations

from dataclasses import dataclass
from enum import {enums}
from typing import Final, Literal

# fmt: off

Access = Literal["ro", "wo", "rw", "rwr", "rww", "const"]
Direction = Literal["", "TPDO", "RPDO", "TPDO/RPDO"]
Value = int | float | str | bytes | None
"""
_ENTRY = '''
@dataclass(frozen=True, slots=True)
class Entry:
    """One entry: default, low and high are None where the file gives none; where plus_node_id is set, default lacks the node ID."""

    index: int
    subindex: int
    name: str
    data_type: DataType
    access: Access
    pdo: Direction = ""
    default: Value = None
    low: int | float | None = None
    high: int | float | None = None
    plus_node_id: bool = False

    def initial(self, node_id: int) -> Value:
        """Return the value after power-up for a node (1 to 127)."""
        return self.default + node_id if self.plus_node_id and isinstance(self.default, int) else self.default

'''
# Names that the module uses besides its entries, and names of the standard library that it imports or needs.
_TAKEN = frozenset(
    ("ENTRIES", "BY_ADDRESS", "SOURCE", "MADE_FOR_NODE", "DEVICE_VENDOR_ID", "DEVICE_PRODUCT_CODE")
) | {"DEVICE_REVISION_NUMBER", *(f"SUPPORTED_MODES_AXIS_{axis}" for axis in range(1, 9)), "SUPPORTED_MODES"}
_CONTROL_BITS = (
    *("SWITCH_ON", "ENABLE_VOLTAGE", "QUICK_STOP", "ENABLE_OPERATION", "FAULT_RESET", "HALT"),
    *("NEW_SET_POINT", "CHANGE_SET_IMMEDIATELY", "RELATIVE", "CHANGE_ON_SET_POINT"),
    *("HOMING_START", "ENABLE_INTERPOLATION"),
)
_STATUS_BITS = (
    *("READY_TO_SWITCH_ON", "SWITCHED_ON", "OPERATION_ENABLED", "FAULT", "VOLTAGE_ENABLED", "QUICK_STOP"),
    *("SWITCH_ON_DISABLED", "WARNING", "REMOTE", "TARGET_REACHED", "INTERNAL_LIMIT"),
    *("SET_POINT_ACKNOWLEDGE", "FOLLOWING_ERROR", "SPEED_ZERO", "MAX_SLIPPAGE"),
    *("HOMING_ATTAINED", "HOMING_ERROR", "FOLLOWS_COMMAND"),
)


def module(eds: Eds, node_id: int | None = None) -> str:
    """Return the text of the module; defaults are those for ``node_id`` (1 to 127); without one they keep ``plus_node_id``."""
    enumerations = [*_data_types(eds), *_enumerations(eds, node_id), *_indices(eds)]
    enums = "IntEnum, IntFlag" if any("(IntFlag)" in line for line in enumerations) else "IntEnum"
    return "\n".join(
        [
            *_docstring(eds),
            *_HEAD.format(enums=enums).splitlines(),
            "",
            *_device(eds, node_id),
            *enumerations,
            "",
            *_ENTRY.splitlines(),
            "",
            *_entries(eds, node_id),
            "",
        ]
    )


def _docstring(eds: Eds) -> Iterator[str]:
    title = _words(f"{overview.overview(eds).title}, from {PurePath(eds.source).name}")
    yield f'"""The object dictionary of {title}.'
    yield ""
    yield "Made by ``axisbus eds code``: make it again instead of changing it."
    yield '"""'


def _words(text: str) -> str:
    """Return a text that is safe in a docstring."""
    return text.encode("ascii", "replace").decode().replace("\\", "/").replace('"', "'").replace("\0", "")


def _device(eds: Eds, node_id: int | None) -> Iterator[str]:
    yield f"SOURCE: Final = {_literal(PurePath(eds.source).name)}"
    who = eds.identity
    for name, number in (
        ("VENDOR_ID", who.vendor_id),
        ("PRODUCT_CODE", who.product_code),
        ("REVISION_NUMBER", who.revision),
    ):
        if number is not None:
            yield f"DEVICE_{name}: Final = 0x{number & 0xFFFF_FFFF:08X}"
    if node_id is not None:
        yield f"MADE_FOR_NODE: Final = {node_id}"


def _data_types(eds: Eds) -> Iterator[str]:
    used = sorted({sub.data_type for entry in eds for sub in entry.subs.values()})
    yield from _enum(
        "DataType",
        "Data types that the device uses, by their index (CiA 301 table 44).",
        {kind.name: f"0x{int(kind):04X}" for kind in used},
    )


def _enumerations(eds: Eds, node_id: int | None) -> Iterator[str]:
    """Yield the enumerations of CiA 402 for the objects that any axis of the device has."""
    there = {first_axis(index) for index in eds.objects}
    if there & {cia402.MODES_OF_OPERATION, cia402.MODES_OF_OPERATION_DISPLAY}:
        yield from _modes(eds, node_id)
    if cia402.CONTROLWORD in there:
        yield from _enum(
            "Command",
            "Controlwords that command the power stage (CiA 402-2 8.4.1).",
            {each.name: f"0x{each.word:04X}" for each in PowerCommand},
        )
        yield from _flags(
            "ControlwordBit", "Bits of the controlword; some by mode.", vars(controlword), _CONTROL_BITS
        )
    if cia402.STATUSWORD in there:
        yield from _flags(
            "StatuswordBit", "Bits of the statusword; some by mode.", vars(statusword), _STATUS_BITS
        )
    for option in options.ALL:
        if option.index in there:
            yield from _enum(
                naming.camel(f"{option.title} option", "Option"),
                f"Values of {wording.place(option.index, option.subindex)}: what {option.title} does.",
                {naming.constant(word, "VALUE"): str(value) for word, value in option.words.items()},
            )


def _modes(eds: Eds, node_id: int | None) -> Iterator[str]:
    yield from _enum(
        "ModeOfOperation",
        "Values of 6060h and 6061h (CiA 402-2 8.4.9).",
        {mode.name: str(mode.value) for mode in (ModeOfOperation.NONE, *modes.FACTS)},
    )
    seen = overview.overview(eds, node_id)
    for axis in range(1, seen.axes + 1):
        claimed = [each for each in seen.claims if each.axis == axis]
        if any(each.claimed is None for each in claimed):
            continue  # 6502h is absent or has no value
        names = ", ".join(f"ModeOfOperation.{each.mode.name}" for each in claimed if each.claimed)
        name = "SUPPORTED_MODES" if seen.axes == 1 else f"SUPPORTED_MODES_AXIS_{axis}"
        if names:
            yield from ("", "", f"{name}: Final[frozenset[ModeOfOperation]] = frozenset(({names},))")


def _flags(name: str, words: str, values: Mapping[str, int], members: tuple[str, ...]) -> Iterator[str]:
    yield from _enum(name, words, {each: f"0x{values[each]:04X}" for each in members}, "IntFlag")


def _enum(name: str, words: str, members: Mapping[str, str], base: str = "IntEnum") -> Iterator[str]:
    yield from ("", "", f"class {name}({base}):", f'    """{words}"""', "")
    for each, value in members.items():
        yield f"    {each} = {value}"


def _indices(eds: Eds) -> Iterator[str]:
    names = naming.unique(
        {index: naming.constant(entry.name, f"OBJECT_{index:04X}") for index, entry in eds.objects.items()},
        lambda index: f"{index:04X}",
    )
    yield from _enum(
        "Index",
        "The index of each object.",
        {name: f"0x{index:04X}" for index, name in names.items()},
    )


def entry_names(eds: Eds) -> dict[tuple[int, int], str]:
    """Return the name of each entry's constant by index and sub-index; all names differ."""
    wanted = {
        (entry.index, sub.subindex): _entry_name(entry, sub) for entry in eds for sub in entry.subs.values()
    }
    return naming.unique(wanted, lambda key: _suffix(eds.objects[key[0]], key[1]), _TAKEN)


def _suffix(entry: Object, subindex: int) -> str:
    return f"{entry.index:04X}_{subindex:02X}" if entry.is_record else f"{entry.index:04X}"


def _entry_name(entry: Object, sub: Variable) -> str:
    owner = naming.constant(entry.name, f"OBJECT_{entry.index:04X}")
    if not entry.is_record:
        return owner
    return f"{owner}_{naming.snake(sub.name).upper() or f'SUB_{sub.subindex:02X}'}"[: naming.MAX_LENGTH]


def _entries(eds: Eds, node_id: int | None) -> Iterator[str]:
    names = entry_names(eds)
    for owner in eds:
        for sub in owner.subs.values():
            name = names[owner.index, sub.subindex]
            yield f"{name}: Final = Entry({', '.join(_arguments(owner, sub, node_id))})"
    yield from ("", "ENTRIES: Final[tuple[Entry, ...]] = (")
    yield from (f"    {name}," for name in names.values())
    yield from (")", "BY_ADDRESS: Final = {(entry.index, entry.subindex): entry for entry in ENTRIES}")


def _arguments(owner: Object, sub: Variable, node_id: int | None) -> Iterator[str]:
    yield f"0x{sub.index:04X}"
    yield f"0x{sub.subindex:02X}"
    yield _literal(wording.full_name(owner, sub))
    yield f"DataType.{sub.data_type.name}"
    yield _literal(sub.access)
    direction = wording.pdo_direction(sub)
    if direction:
        yield _literal(direction)
    yield from _values(sub, node_id)


def _values(sub: Variable, node_id: int | None) -> Iterator[str]:
    given = sub.parameter_value if sub.parameter_value is not None else sub.default
    for key, value in (("default", given), ("low", sub.low), ("high", sub.high)):
        if value is not None:
            yield f"{key}={_literal(value, node_id, sub)}"
    if isinstance(given, Number) and given.plus_node_id and node_id is None:
        yield "plus_node_id=True"


def _literal(
    value: Number | float | str | bytes, node_id: int | None = None, sub: Variable | None = None
) -> str:
    """Return a value as a Python literal in ASCII; an integer in hexadecimal if it is usually read in hexadecimal."""
    if isinstance(value, Number):
        number = value.resolve(node_id)
        return wording.number(number, sub) if sub is not None else str(number)
    if isinstance(value, str):
        escaped = value.encode("unicode_escape").decode("ascii").replace('"', '\\"')
        return f'"{escaped}"'
    return repr(value)
