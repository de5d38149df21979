"""Format an object's value for people: decimal or hexadecimal, its meaning in words, and whether it reports trouble."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.cell.quantities import Quantities
from axisbus.cia301 import objects as c301
from axisbus.cia301.datatypes import Value
from axisbus.cia301.pdo import MappedObject
from axisbus.cia402 import objects as c402
from axisbus.cia402 import state, value_texts
from axisbus.cia402.axes import axis_of, first_axis
from axisbus.cia402.modes import ModeOfOperation
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.trace.decoded import ObjectValue
from axisbus.wording import counted

Modes = Mapping[int, ModeOfOperation]  # axis (from 1) -> its last known mode
NO_MODES: Modes = {}

_COB_ID_TIME = 0x1012
_SDO_PARAMETERS = range(0x1200, 0x1300)
# Arrays and records whose entries, but not their number, are shown in hexadecimal.
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


def in_trouble(index: int, value: Value | None) -> bool:
    """Whether the value is a statusword that reports a fault."""
    if first_axis(index) != c402.STATUSWORD or not isinstance(value, int):
        return False
    return state.decode(value) in (state.PowerState.FAULT, state.PowerState.FAULT_REACTION_ACTIVE)


def in_hex(index: int, subindex: int) -> bool:
    """Whether an object's integer is an identifier or a set of bits."""
    if c301.is_pdo_parameter(index):
        return subindex > 0 if c301.is_pdo_mapping(index) else subindex == c301.PDO_COB_ID
    if index in _SDO_PARAMETERS:
        return subindex in (1, 2)
    return subindex > 0 if index in _HEXADECIMAL_ENTRIES else first_axis(index) in _HEXADECIMAL


def words(index: int, subindex: int, value: Value, dictionary: Dictionary, modes: Modes) -> str:
    """Return the meaning of ``value``; empty if the standard defines none beyond the number."""
    if not isinstance(value, int):
        return ""
    if c301.is_pdo_mapping(index) and subindex:
        return _mapped(value, dictionary)
    return value_texts.words(index, subindex, value, modes.get(axis_of(index)))


def value_of(
    quantities: Quantities,
    node_id: int,
    dictionary: Dictionary,
    entry: DictionaryEntry,
    value: Value,
    modes: Modes = NO_MODES,
) -> ObjectValue:
    """Return a value with its meaning and its unit."""
    meaning = words(entry.index, entry.subindex, value, dictionary, modes)
    quantity = quantities.of(node_id, entry.index, entry.subindex)
    if quantity is None or not isinstance(value, (int, float)):
        return ObjectValue(entry.index, entry.subindex, entry.name, value, meaning)
    return ObjectValue(
        entry.index, entry.subindex, entry.name, value, meaning, quantity.to_unit(value), quantity.unit
    )


def _mapped(entry: int, dictionary: Dictionary) -> str:
    mapped = MappedObject.from_entry(entry)
    if not entry or mapped.is_dummy:
        return "nothing" if not entry else f"{counted(mapped.bits, 'bit')} left free"
    return f"{dictionary.entry(mapped.index, mapped.subindex)}, {counted(mapped.bits, 'bit')}"
