"""The output objects of CiA 401, each with the objects for its behaviour when the module loses its master."""

from __future__ import annotations

from typing import NamedTuple

# Of CiA 402: sub-index 1 the physical outputs, 2 the mask of its effective bits (CiA 402-2, digital outputs).
DRIVE_OUTPUTS = 0x60FE
OUTPUTS, MASK = 1, 2
DEVICE_PROFILE = 401  # the low word of 1000h
PRE_OPERATIONAL, NO_CHANGE, STOPPED = 0, 1, 2  # values of 1029h:01 (CiA 301 7.5.2.32)


class ErrorObjects(NamedTuple):
    """Objects for an output's behaviour in an error: ``mode`` whether it changes, ``value`` its new value.

    ``by_bit``: each bit of both belongs to one bit of the output; otherwise a mode of 1 applies to the whole output.
    """

    mode: int
    value: int
    by_bit: bool

    def word(self, mode: int, value: int, present: int) -> int:
        """Return the value of an output of ``present`` value after an error, by the values of both objects."""
        return present & ~mode | value & mode if self.by_bit else value if mode == 1 else present


# CiA 401-1, error mode and error value of each kind of output.
ERROR_OBJECTS = {
    0x6200: ErrorObjects(0x6206, 0x6207, True),
    0x6300: ErrorObjects(0x6306, 0x6307, True),
    0x6320: ErrorObjects(0x6326, 0x6327, True),
    0x6410: ErrorObjects(0x6443, 0x6444, False),
    0x6411: ErrorObjects(0x6443, 0x6444, False),
    0x6412: ErrorObjects(0x6443, 0x6444, False),
}
