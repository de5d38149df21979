"""How a command moves an axis, and the deceleration of a stop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from axisbus.cia402.options import Ramp

BRAKES = frozenset({Ramp.SLOW, Ramp.QUICK, Ramp.LIMIT})


@dataclass(frozen=True, slots=True)
class Braking:
    """Deceleration of a halt (605Dh) and of a quick stop (605Ah).

    ``quick`` is 6085h, ``most_up`` and ``most_down`` are the drive's own limits of acceleration and deceleration (60C5h, 60C6h);
    all in position increments per s², None: unknown, or not limited.
    """

    halt: Ramp = Ramp.UNKNOWN
    quick_stop: Ramp = Ramp.UNKNOWN
    quick: float | None = None
    most_up: float | None = None
    most_down: float | None = None

    def deceleration(self, ramp: Ramp, slow: float | None) -> float | None:
        """Return the deceleration of ``ramp`` (None: none that is known); ``slow`` is 6084h.

        A ramp at the drive's limit (of current, of voltage) counts as no harder than ``slow``. So does a halt or quick stop without
        an option code, for which the standard defines the slow-down ramp.
        """
        if ramp is Ramp.COAST:
            return None
        return self.capped_down(self.quick if ramp is Ramp.QUICK else slow)

    def capped_up(self, up: float | None) -> float | None:
        """Return an acceleration, limited to the drive's own limit."""
        return _lower(up, self.most_up)

    def capped_down(self, down: float | None) -> float | None:
        """Return a deceleration, limited to the drive's own limit."""
        return _lower(down, self.most_down)


def _lower(value: float | None, limit: float | None) -> float | None:
    return value if value is None or limit is None else min(value, limit)


class CommandedMotion(NamedTuple):
    """The motion of a command, in position increments; None: unknown.

    ``speed`` (per s) is signed, ``up`` (per s²) is the acceleration to it, ``down`` is the profile deceleration 6084h that the
    drive has now. ``by_torque``: a torque moves the axis, its speed cannot be predicted, and a halt of the mode lets it coast.
    ``by_target``: the drive moves to a position and comes to rest there. ``by_core``: the master streams set-points, and a halt
    brakes with ``down``, whatever the drive's own halt (605Dh) is. ``soft``: seconds by which a limit of jerk may prolong its
    ramps. ``unknown``: the drive neither accepted a deceleration (6084h) nor reports its own.
    """

    speed: float | None = None
    up: float | None = None
    down: float | None = None
    by_torque: bool = False
    by_target: bool = False
    by_core: bool = False
    soft: float = 0.0
    unknown: bool = False
