"""Inputs and outputs of a simulated node: set and read by tests; outputs take error values as in CiA 401."""

from __future__ import annotations

from axisbus.eds.model import Eds, Number
from axisbus.sim.dictionary import Dictionary

_PROFILE = 401
# Digital outputs: (error mode, error value), by bit. Analogue outputs: an error mode of 1 applies to the whole channel.
_BITS = {0x6200: (0x6206, 0x6207), 0x6300: (0x6306, 0x6307), 0x6320: (0x6326, 0x6327)}
_CHANNELS = (0x6410, 0x6411, 0x6412)
_MODE, _VALUE = 0x6443, 0x6444


class IoModule:
    """The plant's side of a node's dictionary: sets the inputs and reads the outputs."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary

    def set(self, index: int, subindex: int, value: int) -> None:
        """Set an object of inputs, as the wiring would. Raises KeyError if it does not exist."""
        key = index << 8 | subindex
        self._dictionary.entries[key]
        self._dictionary.live.pop(key, None)
        self._dictionary.set(key, value)

    def set_bit(self, index: int, subindex: int, bit: int, value: bool) -> None:
        """Set one bit of an object of inputs."""
        word = self._dictionary.get_int(index, subindex)
        self.set(index, subindex, word & ~(1 << bit) | int(value) << bit)

    def get(self, index: int, subindex: int) -> int:
        """Return the value of an object of outputs, 0 if it does not exist."""
        return self._dictionary.get_int(index, subindex)

    @property
    def outputs(self) -> dict[tuple[int, int], int]:
        """Values of all output objects, by index and sub-index."""
        keys = [(key >> 8, key & 0xFF) for key in list(self._dictionary.entries)]
        found = [(index, sub) for index, sub in keys if sub and (index in _BITS or index in _CHANNELS)]
        return {address: self._dictionary.get_int(*address) for address in found}

    def fail(self) -> None:
        """Apply an error or NMT *stop*: every output takes its error value if its error mode requires that."""
        for address, word in self.outputs.items():
            self._dictionary.set(address[0] << 8 | address[1], self.error_value(address, word))

    def error_value(self, address: tuple[int, int], word: int) -> int:
        """Return the value of an output after an error; ``word`` is its present value."""
        (index, sub), get = address, self._dictionary.get_int
        if index in _BITS:
            mode, value = (get(of, sub) for of in _BITS[index])
            return word & ~mode | value & mode
        return get(_VALUE, sub) if index in _CHANNELS and get(_MODE, sub) == 1 else word


def is_module(eds: Eds) -> bool:
    """Return whether a file describes an I/O module, by its device type."""
    kind = eds.get(0x1000, 0)
    return kind is not None and isinstance(kind.default, Number) and kind.default.value & 0xFFFF == _PROFILE
