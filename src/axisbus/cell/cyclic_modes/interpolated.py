"""Which axes are led in interpolated position mode (ip), because their drive has no csp."""

from __future__ import annotations

from collections.abc import Set

from axisbus.cell.axis_description import Drive
from axisbus.cia402 import objects
from axisbus.cia402.modes import FACTS, ModeOfOperation

_M = ModeOfOperation
_IP, _CSP = _M.INTERPOLATED_POSITION, _M.CYCLIC_SYNC_POSITION


def interpolates(drive: Drive) -> bool:
    """Whether what is csp to the master is the drive's ip.

    So it is where 6502h claims ip and not csp, unless ``modes`` in the cell file leaves both out; and where ``modes`` has ip alone.
    """
    if not _can(drive):
        return False
    named, claimed = drive.axis.modes, drive.claimed
    if named is not None and FACTS[_CSP].short not in named:
        return FACTS[_IP].short in named
    return claimed is not None and _IP in claimed and _CSP not in claimed


def led_modes(drive: Drive, modes: Set[ModeOfOperation]) -> frozenset[ModeOfOperation]:
    """Return the modes of an axis as motion knows them: ip, where it is led in that, is called csp."""
    return frozenset(modes - {_IP} | {_CSP}) if interpolates(drive) else frozenset(modes)


def _can(drive: Drive) -> bool:
    """Whether it has the objects: the first set-point of 60C1h, and 607Ah, which keeps the newest place for the other modes."""
    found = drive.variable(objects.INTERPOLATION_DATA, 1) is not None
    return found and not drive.missing((objects.TARGET_POSITION, objects.POSITION_ACTUAL))
