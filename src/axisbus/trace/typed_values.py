"""Decode objects' bytes to typed values with name, words and unit; tracks the mode of each axis, which bits depend on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from axisbus.cia301.datatypes import DataType, Value, decode, size_in_bytes
from axisbus.cia301.pdo import MappedObject
from axisbus.cia402 import objects as c402
from axisbus.cia402.axes import axis_of, first_axis
from axisbus.cia402.modes import ModeOfOperation
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.trace import value_text
from axisbus.trace.context import TraceContext
from axisbus.trace.decoded import ObjectValue
from axisbus.wording import counted

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
        return value_text.value_of(
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
