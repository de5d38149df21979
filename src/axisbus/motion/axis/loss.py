"""What an axis has lost, by which what was known of its motion is void; ``AxisCore.forget`` lists what that is."""

from __future__ import annotations

from enum import IntEnum

from axisbus.cia402.state import ENERGISED, PowerState


class Loss(IntEnum):
    """The greater the more is void; each includes the ones before it."""

    OPERATION = 1  # the drive has left operation enabled: its set-points, and what it searched for
    POWER = 2  # nothing drives its motor: all that led the axis
    COUNT = 3  # its positions count from another place, or its node has restarted: all that was told in the old count


def loss_between(before: PowerState, after: PowerState) -> Loss | None:
    """Return what a drive has lost that shows another state; None where it has lost nothing, or that is not known."""
    may_have_had = before is PowerState.UNKNOWN or before in ENERGISED
    if not may_have_had or after is PowerState.UNKNOWN or after is PowerState.OPERATION_ENABLED:
        return None
    return Loss.OPERATION if after in ENERGISED else Loss.POWER
