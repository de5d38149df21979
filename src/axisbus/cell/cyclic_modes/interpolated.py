"""Select the axes that the master commands in interpolated position mode (ip), because their drive has no csp."""

from __future__ import annotations

from collections.abc import Set

from axisbus.cell.axis_description import Drive
from axisbus.cia402 import objects
from axisbus.cia402.modes import FACTS, ModeOfOperation

_M = ModeOfOperation
_IP, _CSP = _M.INTERPOLATED_POSITION, _M.CYCLIC_SYNC_POSITION


def interpolates(drive: Drive) -> bool:
    """Whether the master uses the drive's ip as csp.

    It does if 6502h lists ip and not csp, unless ``modes`` in the cell file lists neither; and if ``modes`` lists only ip of the
    two.
    """
    if not _can(drive):
        return False
    named, claimed = drive.axis.modes, drive.claimed
    if named is not None and FACTS[_CSP].short not in named:
        return FACTS[_IP].short in named
    return claimed is not None and _IP in claimed and _CSP not in claimed


def led_modes(drive: Drive, modes: Set[ModeOfOperation]) -> frozenset[ModeOfOperation]:
    """Return the modes of an axis as motion uses them: ip is replaced by csp if the master uses ip as csp."""
    return frozenset(modes - {_IP} | {_CSP}) if interpolates(drive) else frozenset(modes)


def _can(drive: Drive) -> bool:
    """Whether the objects exist: the first set-point of 60C1h, and 607Ah, which stores the newest position for the other modes."""
    found = drive.variable(objects.INTERPOLATION_DATA, 1) is not None
    return found and not drive.missing((objects.TARGET_POSITION, objects.POSITION_ACTUAL))
