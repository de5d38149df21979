"""The losses of a drive that make known values of its motion void; ``AxisCore.forget`` lists these values."""

from __future__ import annotations

from enum import IntEnum

from axisbus.cia402.state import ENERGISED, PowerState


class Loss(IntEnum):
    """Kinds of loss; a higher one makes more values void, and includes the lower ones."""

    OPERATION = 1  # the drive has left operation enabled: its set-points, and the search of a homing
    POWER = 2  # its motor has no power: all commanded positions
    COUNT = 3  # its positions have another origin, or its node has restarted: all values of the old count


def loss_between(before: PowerState, after: PowerState) -> Loss | None:
    """Return the loss of a drive whose state changes; None if it has lost nothing, or this is unknown."""
    may_have_had = before is PowerState.UNKNOWN or before in ENERGISED
    if not may_have_had or after is PowerState.UNKNOWN or after is PowerState.OPERATION_ENABLED:
        return None
    return Loss.OPERATION if after in ENERGISED else Loss.POWER
