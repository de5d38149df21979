"""Faults of the GIM6010-8 and their meaning.

Theory of operation. 603Fh contains a code of CiA 402, or FF00h for "see the module's own bits", which are in 203Fh (low) and 203Eh
(high). Each part of the firmware (system, axis, motor, controller, encoder) numbers its bits from the lowest, so a bit alone may
mean up to five faults. The code belongs to one of these faults and the error register (1001h) also excludes some. If several
remain, the text names all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from axisbus.cia301.tables import rows

ERROR_BITS_LOW = (0x203F, 0)
ERROR_BITS_HIGH = (0x203E, 0)
ERROR_REGISTER = (0x1001, 0)
OBJECTS = (ERROR_BITS_LOW, ERROR_BITS_HIGH, ERROR_REGISTER)

SEE_BITS = 0xFF00
# The parameter of each category's error word.
WORD_PATHS = {
    "axis": "axis0.error",
    "motor": "axis0.motor.error",
    "encoder": "axis0.encoder.error",
    "controller": "axis0.controller.error",
    "system": "error",
}
_NOT_TOLD = "-"


@dataclass(frozen=True, slots=True)
class GimFault:
    """One fault: the part of the firmware, its bit (one bit of 36), the code in 603Fh, and its bit of 1001h.

    ``code`` and ``register_bit`` are None if undocumented. ``objects`` are the values to compare on CANopen, ``parameter`` on the
    other interfaces; empty if there is none.
    """

    category: str
    name: str
    bits: int
    code: int | None
    register_bit: int | None
    meaning: str
    remedy: str
    objects: str = ""
    parameter: str = ""

    def __str__(self) -> str:
        return self.words(self.objects)

    def words(self, compare: str = "") -> str:
        """Return meaning and remedy, with the values to ``compare`` (its objects or its parameter)."""
        todo = f"{self.remedy}; compare {compare}" if compare else self.remedy
        return f"{self.category} {self.name}: {self.meaning} ({todo})"


def _read() -> tuple[GimFault, ...]:
    return tuple(
        GimFault(
            row["category"],
            row["name"],
            int(row["bits"], 16),
            None if row["code"] == _NOT_TOLD else int(row["code"], 16),
            None if row["register_bit"] == _NOT_TOLD else int(row["register_bit"]),
            row["meaning"],
            row["remedy"],
            row["object"],
            row["parameter"],
        )
        for row in rows(__package__, "faults.tsv")
    )


# From ``faults.tsv``, read on import: the first fault is explained inside the scan, which must not wait for a disk.
FAULTS = _read()


def explain(code: int, details: Mapping[tuple[int, int], int]) -> list[str]:
    """Return the reported faults, one sentence per fault bit; ambiguous bits name every candidate.

    ``code`` is 603Fh (0: not read); ``details`` contains the values of those ``OBJECTS`` that could be read.
    """
    low, high = details.get(ERROR_BITS_LOW, 0), details.get(ERROR_BITS_HIGH, 0)
    bits = (high & 0xFFFFFFFF) << 32 | low & 0xFFFFFFFF
    register = details.get(ERROR_REGISTER)
    if not bits:
        named = [fault for fault in FAULTS if fault.code == code and code != SEE_BITS]
        return (
            [_sentence(_narrowed(named, code, register), f"code 0x{code:04X} without its bits")]
            if named
            else []
        )
    by_bit = {bit: [fault for fault in FAULTS if fault.bits == bit] for bit in _single(bits)}
    # The code belongs to the first bit; bits with other codes came later.
    order = sorted(by_bit, key=lambda bit: all(fault.code != code for fault in by_bit[bit]))
    return [_sentence(_narrowed(by_bit[bit], code, register), f"bit 0x{bit:08X}") for bit in order]


def _single(bits: int) -> list[int]:
    return [1 << place for place in range(bits.bit_length()) if bits >> place & 1]


def _narrowed(faults: Iterable[GimFault], code: int, register: int | None) -> list[GimFault]:
    """Return the faults that fit the code and the error register; a criterion that no fault fits is ignored."""
    left = list(faults)
    if code:
        left = [fault for fault in left if fault.code in (code, None)] or left
    if register:
        here = [fault for fault in left if fault.register_bit is None or register >> fault.register_bit & 1]
        left = here or left
    return left


def words(category: str, error: int) -> list[str]:
    """Return the meaning of an error word, a sentence per bit, with the parameter to compare; an empty list for 0."""
    return [_of_category(category, bit) for bit in _single(error)]


def _of_category(category: str, bit: int) -> str:
    for fault in FAULTS:
        if fault.category == category and fault.bits == bit:
            return f"{fault.words(fault.parameter)} [bit 0x{bit:08X}]"
    return f"{category} bit 0x{bit:08X} is not in the module's fault table"


def _sentence(faults: list[GimFault], what: str) -> str:
    if not faults:
        return f"{what} is not in the module's fault table"
    if len(faults) == 1:
        return f"{faults[0]} [{what}]"
    return f"{what} is ambiguous, one of: {'; '.join(map(str, faults))}"
