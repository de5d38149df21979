"""Format an object's value for people: decimal or hexadecimal, its meaning in words, and whether it reports trouble."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from axisbus.cell.quantities import Quantities
from axisbus.cia301 import objects as c301
from axisbus.cia301.datatypes import DataType, Value, decode, size_in_bytes
from axisbus.cia301.pdo import MappedObject
from axisbus.cia402 import objects as c402
from axisbus.cia402 import state, value_texts
from axisbus.cia402.axes import axis_of, first_axis
from axisbus.cia402.modes import ModeOfOperation
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.trace.context import TraceContext
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


# ----------------------------------------------------------------------------------------------------------------------
# Decode objects' bytes to typed values with name, words and unit; tracks the mode of each axis, which bits depend on.


_MODES = (c402.MODES_OF_OPERATION_DISPLAY, c402.MODES_OF_OPERATION)
_UNSIGNED = {
    8: DataType.UNSIGNED8,
    16: DataType.UNSIGNED16,
    24: DataType.UNSIGNED24,
    32: DataType.UNSIGNED32,
    64: DataType.UNSIGNED64,
}


class Values:
    """Decode object values; holds state: the last mode of operation of each axis of each node."""

    def __init__(self, known: TraceContext) -> None:
        self._known = known
        self._modes: dict[int, dict[int, ModeOfOperation]] = {}
        self._displayed: set[tuple[int, int]] = set()  # node and axis that have shown 6061h
        self._standard = Dictionary()

    def dictionary(self, node: int) -> Dictionary:
        """Return the dictionary of a node; that of the standards if its file is unknown."""
        known = self._known.nodes.get(node)
        return known.dictionary if known is not None else self._standard

    def name(self, node: int, index: int, subindex: int) -> ObjectValue:
        """Return an object without a value."""
        return ObjectValue(index, subindex, self._entry(node, index, subindex).name)

    def of_bytes(
        self, node: int, index: int, subindex: int, data: bytes, *, sized: bool = True
    ) -> tuple[ObjectValue, str]:
        """Return an object's value from SDO data, and the problem with their length (usually empty).

        ``sized`` False: the transfer did not give the number of valid bytes.
        """
        entry = self._entry(node, index, subindex)
        kind = entry.data_type
        size = size_in_bytes(kind) if kind is not None else None
        if kind is None or (size is not None and len(data) < size):
            kind = _UNSIGNED.get(8 * len(data), DataType.OCTET_STRING)
        problem = ""
        if (
            size is not None
            and entry.data_type is not None
            and len(data) != size
            and (sized or len(data) < size)
        ):
            problem = f"{counted(len(data), 'byte')} for {entry.data_type.name}, which has {size}"
        return self._value(node, entry, decode(data, kind)), problem

    def of_pdo(self, node: int, mapping: Sequence[MappedObject], data: bytes) -> Iterator[ObjectValue]:
        """Yield the values of a PDO's data in the order of its mapping, without dummies. The data must be long enough."""
        raw, shift = int.from_bytes(data, "little"), 0
        found = []
        for mapped in mapping:
            bits = raw >> shift & ((1 << mapped.bits) - 1)
            shift += mapped.bits
            if not mapped.is_dummy and mapped.bits:
                entry = self._entry(node, mapped.index, mapped.subindex)
                found.append((entry, _typed(bits, mapped.bits, entry.data_type)))
        for entry, value in found:
            self._note_mode(
                node, entry.index, value
            )  # first: a statusword is decoded by the mode in the same PDO
        for entry, value in found:
            yield self._value(node, entry, value)

    def _entry(self, node: int, index: int, subindex: int) -> DictionaryEntry:
        return self.dictionary(node).entry(index, subindex)

    def _value(self, node: int, entry: DictionaryEntry, value: Value) -> ObjectValue:
        self._note_mode(node, entry.index, value)
        return value_of(
            self._known.quantities, node, self.dictionary(node), entry, value, self._modes.get(node, {})
        )

    def _note_mode(self, node: int, index: int, value: Value) -> None:
        """Note a mode: 6061h wins, because it is the actual mode; before 6061h is seen, the last command (6060h) counts."""
        first = first_axis(index)
        if first not in _MODES or not isinstance(value, int):
            return
        modes = self._modes.setdefault(node, {})
        axis = axis_of(index)
        if first == c402.MODES_OF_OPERATION_DISPLAY:
            self._displayed.add((node, axis))
        elif (node, axis) in self._displayed:
            return
        modes[axis] = ModeOfOperation(value)


def _typed(bits: int, width: int, kind: DataType | None) -> Value:
    """Return ``width`` mapped bits in their type, even if the type has another number of bits."""
    if kind is None or not width:
        return bits
    if kind.integer:
        half = 1 << (width - 1)
        return bits - (half << 1) if kind.signed and bits & half else bits
    return decode(bits.to_bytes((width + 7) // 8, "little"), kind)
