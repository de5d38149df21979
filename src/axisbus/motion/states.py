"""The states of an axis according to PLCopen, and the commands that each state accepts."""

from __future__ import annotations

from enum import Enum


class AxisState(Enum):
    """State of an axis (PLCopen motion control part 1, 2.1)."""

    __hash__ = object.__hash__  # members are looked up in sets in every cycle, and Enum's own is slow

    DISABLED = "Disabled"
    STANDSTILL = "Standstill"
    HOMING = "Homing"
    STOPPING = "Stopping"
    DISCRETE_MOTION = "DiscreteMotion"
    CONTINUOUS_MOTION = "ContinuousMotion"
    SYNCHRONIZED_MOTION = "SynchronizedMotion"
    ERRORSTOP = "ErrorStop"


_A = AxisState
MOVING = frozenset({_A.HOMING, _A.DISCRETE_MOTION, _A.CONTINUOUS_MOTION, _A.SYNCHRONIZED_MOTION})
# A new motion command may take over in these states; only halt, stop, quick stop or disable ends homing.
TAKES_MOTION = frozenset({_A.STANDSTILL, _A.DISCRETE_MOTION, _A.CONTINUOUS_MOTION, _A.SYNCHRONIZED_MOTION})

# Why a motion command is rejected in a state, and the remedy.
REFUSAL = {
    _A.DISABLED: ("is Disabled", "enable it first: axis.enable()"),
    _A.HOMING: ("is Homing", "wait for it, or halt it first: axis.halt()"),
    _A.STOPPING: ("is Stopping", "wait for standstill, then release it: axis.release()"),
    _A.ERRORSTOP: ("is in ErrorStop", "read why (axis.error), then reset it: axis.reset()"),
}
