"""What the library needs to know of a make of drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

Details = Mapping[tuple[int, int], int]
Explain = Callable[[int, Details], list[str]]


def no_explanation(code: int, details: Details) -> list[str]:  # noqa: ARG001  the shape of every ``explain``
    """Explain nothing beyond what CiA 301 and CiA 402 say of an error code."""
    return []


@dataclass(frozen=True, slots=True)
class MeasuredObject:
    """A value that a drive tells: its object, and by what it is to be multiplied; ``of`` is an object that it is a part of."""

    index: int
    subindex: int
    factor: float
    of: int | None = None


# What CiA 402-2 itself defines; temperatures are the makers' own.
STANDARD_MEASURED: Mapping[str, MeasuredObject] = {
    "voltage": MeasuredObject(0x6079, 0, 0.001),  # mV
    "current": MeasuredObject(0x6078, 0, 0.001 * 0.001, of=0x6075),  # ‰ of rated current, which is in mA
}


@dataclass(frozen=True, slots=True)
class Make:
    """One make of drive; the defaults are those of a drive of which nothing is known.

    ``vendor_id`` is that of 1018h:01 and ``product_codes`` those of 1018h:02 (None: any). ``fault_objects`` are to be read, where
    the drive has them, when it is in fault; ``explain(code, details)`` turns 603Fh and their values into sentences.
    ``lists_modes`` says that its 6502h can be believed.
    ``store_restarts`` says that storing parameters (1010h) reboots the drive. ``calibration_objects`` are those that belong to one
    specimen or whose writing makes the motor move to calibrate (sub-index None: all of the object); they are written only when the
    user names them one by one. ``scale_proposal`` is a text for a person: the
    position scale is a setting, never taken from here. ``measured`` names the make's own objects for *temperature* and the like.
    """

    name: str
    vendor_id: int | None = None
    product_codes: frozenset[int] | None = None
    fault_objects: tuple[tuple[int, int], ...] = ()
    explain: Explain = no_explanation
    lists_modes: bool = True
    store_restarts: bool = False
    calibration_objects: tuple[tuple[int, int | None], ...] = ()
    scale_proposal: str = ""
    measured: Mapping[str, MeasuredObject] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def matches(self, vendor_id: int | None, product_code: int | None) -> bool:
        """Whether a drive of this identity (None: unknown) is of this make."""
        if self.vendor_id is None or vendor_id != self.vendor_id:
            return False
        return self.product_codes is None or product_code in self.product_codes

    def calibrates(self, index: int, subindex: int) -> bool:
        """Whether an object is one of ``calibration_objects``."""
        return (index, subindex) in self.calibration_objects or (index, None) in self.calibration_objects


GENERIC = Make("CiA 402 drive")
