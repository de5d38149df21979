"""What the value of a well-known object means, in words: one table of CiA 301 and CiA 402 objects to functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from axisbus.cia301 import abort, cob, emcy
from axisbus.cia301 import objects as c301
from axisbus.cia301.datatypes import Value
from axisbus.cia301.pdo import MappedObject
from axisbus.cia402 import controlword, homing, options, state, statusword
from axisbus.cia402 import objects as c402
from axisbus.cia402.axes import axis_of, first_axis
from axisbus.cia402.modes import ModeOfOperation, short, supported
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.layout import is_pdo_parameter
from axisbus.wording import counted

Modes = Mapping[int, ModeOfOperation]  # axis (from 1) -> its mode as last seen
Reader = Callable[[int, ModeOfOperation | None], str]

_SAVE, _LOAD = 0x6576_6173, 0x6461_6F6C  # "save" and "load" (CiA 301 7.5.2.13, 7.5.2.14)
_COB_ID_TIME = 0x1012
_SDO_PARAMETERS = range(0x1200, 0x1300)
# Arrays and records whose entries, but not their number, are read in hexadecimal.
_HEXADECIMAL_ENTRIES = frozenset(
    {
        *(c301.PREDEFINED_ERROR_FIELD, c301.STORE_PARAMETERS, c301.RESTORE_DEFAULTS),
        *(c301.CONSUMER_HEARTBEAT, c301.IDENTITY),
    }
)
_HEXADECIMAL = frozenset(
    {
        *(c301.DEVICE_TYPE, c301.COB_ID_SYNC, c301.COB_ID_EMCY, _COB_ID_TIME),
        *(
            c402.ERROR_CODE,
            c402.CONTROLWORD,
            c402.STATUSWORD,
            c402.SUPPORTED_DRIVE_MODES,
            c402.DIGITAL_INPUTS,
        ),
        *(c402.POLARITY, c402.SI_UNIT_POSITION, c402.SI_UNIT_VELOCITY, 0x60FE),
    }
)
_DIGITAL_INPUTS = {0: "negative limit switch", 1: "positive limit switch", 2: "home switch", 3: "interlock"}


def status_words(word: int, mode: ModeOfOperation | None = None) -> str:
    """Return state and bits of a statusword, such as ``operation enabled; voltage enabled, target reached``."""
    bits = ", ".join(statusword.bit_words(word, mode))
    return state.decode(word).value + (f"; {bits}" if bits else "")


def in_trouble(index: int, value: Value | None) -> bool:
    """Whether the value is a statusword that shows a fault."""
    if first_axis(index) != c402.STATUSWORD or not isinstance(value, int):
        return False
    return state.decode(value) in (state.State.FAULT, state.State.FAULT_REACTION_ACTIVE)


def in_hex(index: int, subindex: int) -> bool:
    """Whether an object's integer is read as an identifier or bit by bit."""
    if is_pdo_parameter(index):
        return subindex > 0 if index & 0x200 else subindex == c301.PDO_COB_ID
    if index in _SDO_PARAMETERS:
        return subindex in (1, 2)
    return subindex > 0 if index in _HEXADECIMAL_ENTRIES else first_axis(index) in _HEXADECIMAL


def words(index: int, subindex: int, value: Value, dictionary: Dictionary, modes: Modes) -> str:
    """Return what ``value`` means; empty where the standard gives it no meaning beyond the number."""
    if not isinstance(value, int):
        return ""
    if is_pdo_parameter(index):
        return _pdo_words(index, subindex, value, dictionary)
    first = first_axis(index)
    reader = _READERS.get((first, subindex)) or _ANY_SUBINDEX.get(first)
    if reader is None or (subindex == 0 and first in _ANY_SUBINDEX):
        return ""
    return reader(value, modes.get(axis_of(index)))


def _pdo_words(index: int, subindex: int, value: int, dictionary: Dictionary) -> str:
    if index & 0x200:  # 16xxh and 1Axxh
        return _mapped(value, dictionary) if subindex else ""
    if subindex == c301.PDO_COB_ID:
        return _cob_words(value)
    return _transmission(value) if subindex == c301.PDO_TRANSMISSION_TYPE else ""


def _mapped(entry: int, dictionary: Dictionary) -> str:
    mapped = MappedObject.from_entry(entry)
    if not entry or mapped.is_dummy:
        return "nothing" if not entry else f"{counted(mapped.bits, 'bit')} left free"
    return f"{dictionary.entry(mapped.index, mapped.subindex)}, {counted(mapped.bits, 'bit')}"


def _cob_words(value: int, _: ModeOfOperation | None = None) -> str:
    identifier = value & (cob.ID_MASK_29 if value & cob.EXTENDED else cob.ID_MASK_11)
    return f"{identifier:03X}h" + (", switched off" if value & cob.INVALID else "")


def _transmission(value: int) -> str:
    if value == 0:
        return "synchronous, acyclic"
    if value <= 240:
        return "with every SYNC" if value == 1 else f"with every {value}th SYNC"
    return {252: "on remote request", 253: "on remote request"}.get(
        value, "event-driven" if value >= 254 else "reserved"
    )


def _mode(value: int, _: ModeOfOperation | None) -> str:
    mode = ModeOfOperation(value)
    return "no mode" if mode is ModeOfOperation.NONE else f"{short(mode)}, {mode.text}"


def _option(meanings: Mapping[int, str]) -> Reader:
    return lambda value, _: meanings.get(value, "specific to the maker" if value < 0 else "reserved")


def _signature(number: int, text: str) -> Reader:
    return lambda value, _: text if value == number else ""


def _bits(names: Mapping[int, str]) -> Reader:
    return lambda value, _: ", ".join(name for bit, name in names.items() if value >> bit & 1)


def _consumer(value: int, _: ModeOfOperation | None) -> str:
    node, time = value >> 16 & 0x7F, value & 0xFFFF
    return f"node {node} within {time} ms" if node and time else "off"


def _error_code(value: int, _: ModeOfOperation | None) -> str:
    return emcy.explain(value & 0xFFFF) if value & 0xFFFF else "no error"


_READERS: dict[tuple[int, int], Reader] = {
    (c402.STATUSWORD, 0): status_words,
    (c402.CONTROLWORD, 0): controlword.words,
    (c402.MODES_OF_OPERATION, 0): _mode,
    (c402.MODES_OF_OPERATION_DISPLAY, 0): _mode,
    (c402.SUPPORTED_DRIVE_MODES, 0): lambda value, _: ", ".join(short(mode) for mode in supported(value)),
    (c402.HOMING_METHOD, 0): lambda value, _: homing.describe(value),
    (c402.ERROR_CODE, 0): _error_code,
    (c402.DIGITAL_INPUTS, 0): _bits(_DIGITAL_INPUTS),
    (c301.ERROR_REGISTER, 0): lambda value, _: ", ".join(emcy.register_words(value)) or "no error",
    (c301.COB_ID_SYNC, 0): _cob_words,
    (c301.COB_ID_EMCY, 0): _cob_words,
    (c301.PRODUCER_HEARTBEAT, 0): lambda value, _: f"{value} ms" if value else "off",
    (c301.GUARD_TIME, 0): lambda value, _: f"{value} ms" if value else "off",
    **{(option.index, option.subindex): _option(option.meanings) for option in options.ALL},
}
_ANY_SUBINDEX: dict[int, Reader] = {
    c301.PREDEFINED_ERROR_FIELD: _error_code,
    c301.CONSUMER_HEARTBEAT: _consumer,
    c301.STORE_PARAMETERS: _signature(_SAVE, 'store ("save")'),
    c301.RESTORE_DEFAULTS: _signature(_LOAD, 'restore defaults ("load")'),
}


def abort_words(code: int) -> str:
    """Return an abort code with its text."""
    return abort.describe(code)
