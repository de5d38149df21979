"""The inputs and outputs of a stand-in: set and looked at from outside, and what its outputs do when it is left alone (CiA 401)."""

from __future__ import annotations

from axisbus.eds.model import Eds, Number
from axisbus.sim.dictionary import Dictionary

_PROFILE = 401
# Outputs: (error mode, error value), by bits; and those where a mode of 1 means the whole channel.
_BITS = {0x6200: (0x6206, 0x6207), 0x6300: (0x6306, 0x6307), 0x6320: (0x6326, 0x6327)}
_CHANNELS = (0x6410, 0x6411, 0x6412)
_MODE, _VALUE = 0x6443, 0x6444


class IoModule:
    """The plant's side of a node's dictionary: what is wired to its inputs, and what its outputs show."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary

    def set(self, index: int, subindex: int, value: int) -> None:
        """Let an object of inputs have a value, as what is wired to it would; KeyError where there is none."""
        key = index << 8 | subindex
        self._dictionary.entries[key]
        self._dictionary.live.pop(key, None)
        self._dictionary.set(key, value)

    def set_bit(self, index: int, subindex: int, bit: int, value: bool) -> None:
        """Let one bit of an object of inputs have a value."""
        word = self._dictionary.get_int(index, subindex)
        self.set(index, subindex, word & ~(1 << bit) | int(value) << bit)

    def get(self, index: int, subindex: int) -> int:
        """Return what an object of outputs has, 0 where there is none."""
        return self._dictionary.get_int(index, subindex)

    @property
    def outputs(self) -> dict[tuple[int, int], int]:
        """What every object of a module's outputs has, by index and sub-index."""
        keys = [(key >> 8, key & 0xFF) for key in list(self._dictionary.entries)]
        found = [(index, sub) for index, sub in keys if sub and (index in _BITS or index in _CHANNELS)]
        return {address: self._dictionary.get_int(*address) for address in found}

    def fail(self) -> None:
        """An error, or NMT *stop*: every output whose error mode says so takes its error value."""
        for address, word in self.outputs.items():
            self._dictionary.set(address[0] << 8 | address[1], self.alone(address, word))

    def alone(self, address: tuple[int, int], word: int) -> int:
        """Return what an output of this value becomes in an error."""
        (index, sub), get = address, self._dictionary.get_int
        if index in _BITS:
            mode, value = (get(of, sub) for of in _BITS[index])
            return word & ~mode | value & mode
        return get(_VALUE, sub) if index in _CHANNELS and get(_MODE, sub) == 1 else word


def is_module(eds: Eds) -> bool:
    """Whether a file describes an I/O module, by its device type."""
    kind = eds.get(0x1000, 0)
    return kind is not None and isinstance(kind.default, Number) and kind.default.value & 0xFFFF == _PROFILE
