"""How an axis that moves freely is led, and what a stop brakes it with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from axisbus.cia402.options import Ramp

BRAKES = frozenset({Ramp.SLOW, Ramp.QUICK, Ramp.LIMIT})


@dataclass(frozen=True, slots=True)
class Braking:
    """What a halt (605Dh) and a quick stop (605Ah) brake with; ``quick`` is 6085h in position increments per s² (None: unknown)."""

    halt: Ramp = Ramp.UNKNOWN
    quick_stop: Ramp = Ramp.UNKNOWN
    quick: float | None = None

    def deceleration(self, ramp: Ramp, slow: float | None) -> float | None:
        """Return what ``ramp`` brakes with, ``slow`` being 6084h; the drive's limit counts as no harder than that."""
        return self.quick if ramp is Ramp.QUICK and self.quick else slow


class Course(NamedTuple):
    """Where a command leads the axis, in position increments; None: not known.

    ``speed`` (per s) is signed, ``up`` (per s²) leads to it, ``down`` is the profile deceleration 6084h that the drive has by now.
    ``by_torque``: the axis is pushed, nobody knows how fast it will get, and a halt of the mode lets it coast. ``by_target``: it
    goes to a position, and comes to rest there by itself. ``by_core``: it is led from cycle to cycle, and a halt brakes it with
    ``down``, whatever the drive's own halt (605Dh) is. ``soft``: seconds by which a limit of jerk may prolong its ramps.
    """

    speed: float | None = None
    up: float | None = None
    down: float | None = None
    by_torque: bool = False
    by_target: bool = False
    by_core: bool = False
    soft: float = 0.0
