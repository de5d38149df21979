"""Meanings of the values and bits of well-known objects of CiA 301 and CiA 402: as tables, and as text for one value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from axisbus.cia301 import cob, emcy
from axisbus.cia301 import objects as cia301
from axisbus.cia301.nmt import watched_node
from axisbus.cia402 import controlword, homing, modes, options, state, statusword
from axisbus.cia402 import objects as cia402
from axisbus.cia402.axes import first_axis
from axisbus.cia402.modes import ModeOfOperation

Reader = Callable[[int, ModeOfOperation | None], str]


class Table(NamedTuple):
    """One table: its title, the heading of its first column, and rows of (value or bit, meaning)."""

    title: str
    key: str
    rows: tuple[tuple[str, str], ...]


class Meaning(NamedTuple):
    """Meaning of an object: its tables, and a function for the meaning of one value (in a mode of operation, None: unknown)."""

    tables: tuple[Table, ...]
    words: Reader


def tables(index: int, subindex: int) -> tuple[Table, ...]:
    """Return the tables of the standards for an entry of any axis; empty if there are none.

    Tables that apply to all elements of an array are returned for the first element.
    """
    found = _of_entry(index, subindex) or (_ELEMENTS.get(index) if subindex == 1 else None)
    return found.tables if found is not None else ()


def words(index: int, subindex: int, value: int, mode: ModeOfOperation | None = None) -> str:
    """Return the meaning of a value; empty if the standards give it no meaning beyond the number.

    ``mode`` is that of the axis; it determines the meaning of some bits of the controlword and of the statusword.
    """
    found = _of_entry(index, subindex) or (_ELEMENTS.get(index) if subindex else None)
    return found.words(value, mode) if found is not None else ""


def _of_entry(index: int, subindex: int) -> Meaning | None:
    if cia301.is_pdo_parameter(index):
        return None if cia301.is_pdo_mapping(index) else _PDO.get(subindex)
    return _ENTRIES.get((first_axis(index), subindex))


# -- construction of tables, and texts for one value ---------------------------------------------------------------------------


def _bits(title: str, names: Mapping[int, str]) -> Table:
    return Table(title, "bit", tuple((str(bit), names[bit]) for bit in sorted(names)))


def _values(title: str, names: Mapping[int, str]) -> Table:
    return Table(title, "value", tuple((str(value), text) for value, text in names.items()))


def _named_bits(names: Mapping[int, str]) -> Reader:
    return lambda value, _: ", ".join(name for bit, name in names.items() if value >> bit & 1)


def _time(value: int, _: ModeOfOperation | None) -> str:
    return f"{value} ms" if value else "off"


def _cob_id(value: int, _: ModeOfOperation | None) -> str:
    identifier = value & (cob.ID_MASK_29 if value & cob.EXTENDED else cob.ID_MASK_11)
    return f"{identifier:03X}h" + (", switched off" if value & cob.INVALID else "")


# -- communication (CiA 301 7.5.2) -----------------------------------------------------------------------------------------------


def _register(value: int, _: ModeOfOperation | None) -> str:
    return ", ".join(emcy.register_words(value)) or "no error"


def _error_code(value: int, _: ModeOfOperation | None) -> str:
    return emcy.explain(value & 0xFFFF) if value & 0xFFFF else "no error"


def _consumer(value: int, _: ModeOfOperation | None) -> str:
    node = watched_node(value)
    return f"node {node} within {value & 0xFFFF} ms" if node else "off"


def _signature(letters: str, does: str, order: str) -> Meaning:
    """Return the meaning of an object that acts when these letters are written into it."""
    number = int.from_bytes(letters.encode("ascii"), "little")
    return Meaning(
        (Table("Values", "value", ((f"0x{number:08X}", f'{does}: the letters "{letters}"'),)),),
        lambda value, _: f'{order} ("{letters}")' if value == number else "",
    )


def _transmission(value: int, _: ModeOfOperation | None) -> str:
    if value == 0:
        return "synchronous, acyclic"
    if value <= 240:
        return "with every SYNC" if value == 1 else f"with every {value}th SYNC"
    if value >= 254:
        return "event-driven"
    return "on remote request" if value >= 252 else "reserved"


# -- drives (CiA 402-2) ----------------------------------------------------------------------------------------------------------

# CiA 402-2 8.4.1 and 8.4.2.
_CONTROL_BITS = {
    0: "switch on",
    1: "enable voltage",
    2: "quick stop (0 = stop)",
    3: "enable operation",
    4: "specific to the mode: pp new set-point, hm homing start, ip enable interpolation",
    5: "specific to the mode: pp change set immediately",
    6: "specific to the mode: pp relative",
    7: "fault reset (rising edge)",
    8: "halt",
    9: "specific to the mode: pp change on set-point",
    10: "reserved",
    **dict.fromkeys(range(11, 16), "manufacturer-specific"),
}
_DIGITAL_INPUTS = {0: "negative limit switch", 1: "positive limit switch", 2: "home switch", 3: "interlock"}


def _status_bits() -> dict[int, str]:
    bits = {
        0: "ready to switch on",
        1: "switched on",
        2: "operation enabled",
        3: "fault",
        5: "quick stop (0 = active)",
        6: "switch on disabled",
        14: "manufacturer-specific",
        15: "manufacturer-specific",
        **statusword.COMMON_BITS,
    }
    for bit in (12, 13):
        readings: dict[str, list[str]] = {}
        for mode, names in statusword.MODE_BITS.items():
            if bit in names:
                readings.setdefault(names[bit], []).append(modes.short(mode))
        each = ", ".join(f"{' '.join(shorts)} {name}" for name, shorts in readings.items())
        bits[bit] = f"specific to the mode: {each}"
    return bits


def _commands() -> Table:
    rows = tuple(
        (f"0x{each.word:04X}", each.name.lower().replace("_", " ")) for each in controlword.PowerCommand
    )
    return Table("Commands", "controlword", rows)


def _states() -> Table:
    rows = tuple(
        (f"0x{value:04X}, mask 0x{mask:04X}", each.value) for mask, value, each in state.STATUSWORD_PATTERNS
    )
    return Table("States", "statusword", rows)


def _status(word: int, mode: ModeOfOperation | None) -> str:
    """Return state and bits of a statusword, such as ``operation enabled; voltage enabled, target reached``."""
    bits = ", ".join(statusword.bit_words(word, mode))
    return state.decode(word).value + (f"; {bits}" if bits else "")


def _mode(value: int, _: ModeOfOperation | None) -> str:
    mode = ModeOfOperation(value)
    return "no mode" if mode is ModeOfOperation.NONE else f"{modes.short(mode)}, {mode.text}"


def _modes() -> Table:
    names = {mode.value: f"{mode.text} ({facts.short})" for mode, facts in modes.FACTS.items()}
    return _values("Modes", {ModeOfOperation.NONE.value: "no mode", **names})


def _supported(word: int, _: ModeOfOperation | None) -> str:
    return ", ".join(modes.short(mode) for mode in modes.supported(word))


def _homing_methods() -> Table:
    rows: list[tuple[str, str]] = [("negative", "manufacturer-specific")]
    for method, text in homing.METHODS.items():
        if rows[-1][1] == text:
            rows[-1] = (f"{rows[-1][0].partition('-')[0]}-{method}", text)
        else:
            rows.append((str(method), text))
    return Table("Homing methods", "value", tuple(rows))


def _option(option: options.OptionCode) -> Meaning:
    known = option.meanings
    return Meaning(
        (_values(f"What {option.title} does", known),),
        lambda value, _: known.get(value, "manufacturer-specific" if value < 0 else "reserved"),
    )


# -- the table: index and sub-index on the first axis -> meaning of its values ---------------------------------------------------

_ENTRIES: Mapping[tuple[int, int], Meaning] = {
    (cia301.ERROR_REGISTER, 0): Meaning((_bits("Bits", emcy.REGISTER_BITS),), _register),
    (cia301.COB_ID_SYNC, 0): Meaning((), _cob_id),
    (cia301.COB_ID_EMCY, 0): Meaning((), _cob_id),
    (cia301.GUARD_TIME, 0): Meaning((), _time),
    (cia301.PRODUCER_HEARTBEAT, 0): Meaning((), _time),
    (cia402.ERROR_CODE, 0): Meaning((), _error_code),
    (cia402.CONTROLWORD, 0): Meaning((_commands(), _bits("Bits", _CONTROL_BITS)), controlword.words),
    (cia402.STATUSWORD, 0): Meaning((_states(), _bits("Bits", _status_bits())), _status),
    (cia402.MODES_OF_OPERATION, 0): Meaning((_modes(),), _mode),
    (cia402.MODES_OF_OPERATION_DISPLAY, 0): Meaning((_modes(),), _mode),
    (cia402.SUPPORTED_DRIVE_MODES, 0): Meaning(
        (
            _bits(
                "Modes",
                {facts.supported_bit: f"{mode.text} ({facts.short})" for mode, facts in modes.FACTS.items()},
            ),
        ),
        _supported,
    ),
    (cia402.HOMING_METHOD, 0): Meaning((_homing_methods(),), lambda value, _: homing.describe(value)),
    (cia402.POLARITY, 0): Meaning(
        (_bits("Bits", {6: "velocity: 1 multiplies by -1", 7: "position: 1 multiplies by -1"}),),
        lambda _, __: "",
    ),
    (cia402.DIGITAL_INPUTS, 0): Meaning(
        (
            Table(
                "Bits",
                "bit",
                (
                    *_bits("", _DIGITAL_INPUTS).rows,
                    ("4-15", "reserved"),
                    ("16-31", "manufacturer-specific"),
                ),
            ),
        ),
        _named_bits(_DIGITAL_INPUTS),
    ),
    **{(option.index, option.subindex): _option(option) for option in options.ALL},
}
# For each element of an array.
_ELEMENTS: Mapping[int, Meaning] = {
    cia301.PREDEFINED_ERROR_FIELD: Meaning((), _error_code),
    cia301.STORE_PARAMETERS: _signature("save", "stores", "store"),
    cia301.RESTORE_DEFAULTS: _signature("load", "restores", "restore defaults"),
    cia301.CONSUMER_HEARTBEAT: Meaning(
        (Table("Bits", "bit", (("0-15", "heartbeat time in ms"), ("16-23", "node ID that is watched"))),),
        _consumer,
    ),
}
# Sub-indices of 14xxh and 18xxh (CiA 301 7.5.2.35, 7.5.2.37).
_PDO: Mapping[int, Meaning] = {
    cia301.PDO_COB_ID: Meaning(
        (
            Table(
                "Bits",
                "bit",
                (
                    ("0-10", "CAN identifier (0-28 with bit 29)"),
                    ("29", "1: identifier of 29 bits"),
                    ("30", "TPDO, 1: no remote request"),
                    ("31", "1: the PDO is switched off"),
                ),
            ),
        ),
        _cob_id,
    ),
    cia301.PDO_TRANSMISSION_TYPE: Meaning(
        (
            Table(
                "Values",
                "value",
                (
                    ("0", "synchronous, acyclic"),
                    ("1-240", "synchronous: with every n-th SYNC"),
                    ("252-253", "on remote request (TPDO)"),
                    ("254", "event-driven, manufacturer-specific"),
                    ("255", "event-driven, as the device profile says"),
                ),
            ),
        ),
        _transmission,
    ),
}
