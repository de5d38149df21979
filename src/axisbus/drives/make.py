"""Definition of a drive plug-in: the properties of a vendor's drive family that the library uses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

Details = Mapping[tuple[int, int], int]
Explain = Callable[[int, Details], list[str]]


def no_explanation(code: int, details: Details) -> list[str]:  # noqa: ARG001  the shape of every ``explain``
    """Return no explanation beyond those of CiA 301 and CiA 402 for an error code."""
    return []


@dataclass(frozen=True, slots=True)
class MeasuredObject:
    """A measured value of a drive: its object and factor; ``of`` is the index of the reference value of a relative value."""

    index: int
    subindex: int
    factor: float
    of: int | None = None


# Defined by CiA 402-2; objects of temperatures are manufacturer-specific.
STANDARD_MEASURED: Mapping[str, MeasuredObject] = {
    "voltage": MeasuredObject(0x6079, 0, 0.001),  # mV
    "current": MeasuredObject(0x6078, 0, 0.001 * 0.001, of=0x6075),  # ‰ of rated current, which is in mA
}


@dataclass(frozen=True, slots=True)
class Make:
    """One drive plug-in; the defaults are for an unknown drive.

    ``vendor_id`` is 1018h:01 and ``product_codes`` are the values of 1018h:02 (None: any). ``fault_objects`` are the objects to
    read when the drive is in fault, if it has them; ``explain(code, details)`` turns 603Fh and their values into sentences.
    ``lists_modes``: its 6502h is correct. ``store_restarts``: storing parameters (1010h) reboots the drive. ``calibration_objects``
    are objects that belong to one specimen, or whose writing moves the motor for a calibration (sub-index None: the whole object);
    they are written only if the user names them one by one. ``scale_proposal`` is a text for the user: the position scale is a
    setting, never taken from here. ``measured`` maps *temperature* and the like to the manufacturer's objects.
    ``unread_watchdog`` is a sentence about a watchdog of the make that no object reads, for the report of boot-up.
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
    unread_watchdog: str = ""

    def matches(self, vendor_id: int | None, product_code: int | None) -> bool:
        """Whether a drive with this identity (None: unknown) belongs to this plug-in."""
        if self.vendor_id is None or vendor_id != self.vendor_id:
            return False
        return self.product_codes is None or product_code in self.product_codes

    def calibrates(self, index: int, subindex: int) -> bool:
        """Whether an object is one of ``calibration_objects``."""
        return (index, subindex) in self.calibration_objects or (index, None) in self.calibration_objects


GENERIC = Make("CiA 402 drive")
