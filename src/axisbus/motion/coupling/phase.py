"""How far a slave sees its master from where that is: a shift that is changed while both go on (MC_PhasingRelative)."""

from __future__ import annotations

from axisbus.motion.commands import PhaseBy
from axisbus.motion.superimposed.offset_profile import Shift


class PhaseShift:
    """Holds the shift (``value``, units of the master), and how it changes."""

    def __init__(self, period: float) -> None:
        """``period``: of the scan, in seconds."""
        self._shift = Shift(period)

    @property
    def value(self) -> float:
        """How far it is shifted now."""
        return self._shift.value

    @property
    def over(self) -> bool:
        """Whether nothing changes it now."""
        return self._shift.at_rest

    def change(self, command: PhaseBy) -> None:
        """Go on by so much more, from the shift and the speed that it has now; what is still to come of a change is kept."""
        end = self._shift.end + command.shift
        self._shift.aim(end, command.velocity, command.acceleration, command.acceleration)

    def step(self) -> None:
        """Once per cycle of the slave in step."""
        if not self._shift.at_rest:
            self._shift.go(self._shift.wanted())
