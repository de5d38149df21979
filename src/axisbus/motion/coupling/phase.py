"""The phase shift between a slave and its master, which can be changed while both move (MC_PhasingRelative)."""

from __future__ import annotations

from axisbus.motion.commands import PhaseBy
from axisbus.motion.superimposed.offset_profile import Shift


class PhaseShift:
    """Holds the shift (``value``, in units of the master) and its change in progress."""

    def __init__(self, period: float) -> None:
        """``period``: scan period in seconds."""
        self._shift = Shift(period)

    @property
    def value(self) -> float:
        """The present shift in units of the master."""
        return self._shift.value

    @property
    def over(self) -> bool:
        """Whether no change is in progress."""
        return self._shift.at_rest

    def change(self, command: PhaseBy) -> None:
        """Change the shift by ``command.shift`` more, from its present value and rate; the rest of an earlier change is added."""
        end = self._shift.end + command.shift
        self._shift.aim(end, command.velocity, command.acceleration, command.acceleration)

    def step(self) -> None:
        """Advance by one cycle of the synchronised slave."""
        if not self._shift.at_rest:
            self._shift.go(self._shift.wanted())
