"""A trajectory as the scan calls it: user code whose errors end its command and nothing else."""

from __future__ import annotations

from math import isfinite

from axisbus.errors import ArgumentError, one_line
from axisbus.interrupt_guard import is_own
from axisbus.motion.numbers import number, told
from axisbus.motion.trajectory import Trajectory

_DURATION = "correct its duration, which must always return the same number"
_POSITION = "correct its position(t), which must return a number for every t from 0 to its duration; the axis was stopped"


class CheckedTrajectory:
    """Holds a trajectory, and its ``duration``, read once; all other properties are read from the trajectory itself."""

    __slots__ = ("_name", "_trajectory", "duration")

    def __init__(self, trajectory: Trajectory, name: str) -> None:
        """``name``: the axis.

        Raises:
            ArgumentError: it has no valid duration.
        """
        self._trajectory = trajectory
        self._name = name
        try:
            told: object = trajectory.duration
        except BaseException as error:
            if not is_own(error):
                raise
            raise self._broken(error, "duration", _DURATION) from error
        self.duration = self._number(told, "duration", _DURATION)

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds.

        Raises:
            ArgumentError: the trajectory returns no number.
        """
        try:
            value = self._trajectory.position(t)
        except BaseException as error:
            if not is_own(error):
                raise
            raise self._broken(error, f"position at {t:.3f} s", _POSITION) from error
        if type(value) is float and isfinite(value):  # in nearly every cycle
            return value
        return self._number(value, f"position at {t:.3f} s", _POSITION)

    def _broken(self, error: BaseException, what: str, remedy: str) -> ArgumentError:
        """Return the error that ends the command when the trajectory's own code has raised; ``what``: the requested value."""
        return ArgumentError(self._message(what), observed=one_line(error), remedy=remedy)

    def _number(self, value: object, what: str, remedy: str) -> float:
        """Return a value of the trajectory's own code as a number; any other value ends the command, and the error shows it."""
        found = number(value)
        if found is None:
            raise ArgumentError(self._message(what), observed=f"it returned {told(value)}", remedy=remedy)
        return found

    def _message(self, what: str) -> str:
        return f"{self._name}: the trajectory returned no {what}"
