"""How far a slave sees its master from where that is: a shift that is changed while both go on (MC_PhasingRelative)."""

from __future__ import annotations

from axisbus.motion.commands import PhaseBy
from axisbus.motion.moves.onward import Onward, Start


class Phase:
    """Holds the shift (``value``, units of the master) and the way on which it changes, a trapezoid over time."""

    def __init__(self, period: float) -> None:
        """``period``: of the scan, in seconds."""
        self.value = 0.0
        self._period = period
        self._way: Onward | None = None
        self._t = 0.0

    @property
    def over(self) -> bool:
        """Whether nothing changes it now."""
        return self._way is None

    def change(self, command: PhaseBy) -> None:
        """Go on by so much more, from the shift and the speed that it has now; what is still to come of a change is kept."""
        way, ramp = self._way, command.acceleration
        end, speed = (self.value, 0.0) if way is None else (way.end, way.speed(self._t))
        self._way = Onward(Start(self.value, speed), end + command.shift, command.velocity, ramp, ramp)
        self._t = 0.0

    def step(self) -> None:
        """Once per cycle of the slave in step."""
        way = self._way
        if way is None:
            return
        self._t += self._period
        self.value = way.position(self._t)
        if self._t >= way.duration:
            self._way = None
