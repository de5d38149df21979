"""One named input or output: its location in the node, and the meaning of its raw value."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from numbers import Real

from axisbus.errors import ArgumentError

Value = bool | int | float
Address = tuple[int, int]  # index and sub-index


@dataclass(frozen=True, slots=True)
class IoPoint:
    """An input or output of a node: one ``bit`` of an object of ``width`` bits, or (None) the whole object as a number.

    ``safe`` is the raw value that an output gets when the node, the program or the master is lost; it has no meaning for an input.
    A number is ``raw / scale + offset`` in ``unit``; without ``scale`` it is the raw integer.
    """

    name: str
    node: int
    index: int
    subindex: int
    width: int
    signed: bool
    output: bool
    bit: int | None = None
    safe: int = 0
    scale: Fraction | None = None
    offset: float = 0.0
    unit: str = ""

    @property
    def address(self) -> Address:
        """Index and sub-index of its object."""
        return self.index, self.subindex

    @property
    def object_text(self) -> str:
        """Its object and bit, such as ``6200h:01 bit 3``."""
        where = f"{self.index:04X}h:{self.subindex:02X}"
        return where if self.bit is None else f"{where} bit {self.bit}"

    @property
    def range(self) -> tuple[int, int]:
        """The lowest and the highest raw value."""
        if self.bit is not None:
            return 0, 1
        half = 1 << self.width - 1
        return (-half, half - 1) if self.signed else (0, 2 * half - 1)

    @property
    def mask(self) -> int:
        """The bits of its object that belong to it."""
        return (1 << self.width) - 1 if self.bit is None else 1 << self.bit

    def of(self, word: int) -> int:
        """Return its raw value from the value of its object."""
        return word if self.bit is None else word >> self.bit & 1

    def into(self, word: int, raw: int) -> int:
        """Return the value of its object with its raw value inserted; the other bits are unchanged."""
        if self.bit is None:
            return raw
        made = word & ((1 << self.width) - 1) & ~(1 << self.bit) | raw << self.bit
        return made - (1 << self.width) if self.signed and made >> self.width - 1 == 1 else made

    def shown(self, raw: int) -> Value:
        """Return the meaning of a raw value: True or False for a bit, else a number in ``unit``."""
        if self.bit is not None:
            return bool(raw)
        return raw if self.scale is None else float(raw / self.scale) + self.offset

    def raw(self, value: Value) -> int:
        """Return the raw value nearest to ``value``.

        Raises:
            ArgumentError: the value has the wrong kind, or the object cannot hold it.
        """
        raw = self._bit(value) if self.bit is not None else self._number(value)
        low, high = self.range
        if not low <= raw <= high:
            raise ArgumentError(
                f"{self.name} cannot be {_shown(value)}{self._in_unit}",
                observed=f"{self.object_text} holds {self.shown(low):g} to {self.shown(high):g}{self._in_unit}",
                remedy="give a value in this range",
            )
        return raw

    @property
    def _in_unit(self) -> str:
        return f" {self.unit}" if self.unit else ""

    def _bit(self, value: Value) -> int:
        if isinstance(value, bool) or (isinstance(value, int) and value in (0, 1)):
            return int(value)
        raise ArgumentError(
            f"{self.name} cannot be {_shown(value)}", observed="it is one bit", remedy="give True or False"
        )

    def _number(self, value: Value) -> int:
        exact = self._exact(value)
        if exact is None or (self.scale is None and exact.denominator != 1):
            expected = "a number" if self.scale is not None else "an integer: it has no scale"
            raise ArgumentError(
                f"{self.name} cannot be {_shown(value)}",
                observed=f"it is {expected}",
                remedy=f"give {expected}",
            )
        return int(exact) if self.scale is None else round((exact - Fraction(self.offset)) * self.scale)

    def _exact(self, value: object) -> Fraction | None:
        """Return a finite number as a fraction, None for anything else; numbers of numpy are accepted."""
        if isinstance(value, bool) or not isinstance(value, Real):
            return None
        try:
            return Fraction(value) if isinstance(value, (int, float)) else Fraction(float(value))
        except Exception:  # noqa: BLE001  # NaN, infinity, or a type of the program's own
            return None


def _shown(value: object) -> str:
    """Return a value's representation, cut to a line; an integer of thousands of digits has none."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001  # or a type of the program's own
        return f"a {type(value).__name__}"
    return text if len(text) <= 40 else f"{text[:40]}..."


def addresses(points: Iterable[IoPoint], *, output: bool) -> tuple[Address, ...]:
    """Return the objects of the outputs, or of the inputs, each once, in ascending order."""
    return tuple(sorted({point.address for point in points if point.output is output}))
