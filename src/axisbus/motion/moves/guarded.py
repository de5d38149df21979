"""A trajectory as the scan calls it: a program's own code, of which a mistake ends its command and nothing else."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.errors import ArgumentError, in_a_line
from axisbus.interruption import is_own
from axisbus.motion.numbers import number, told
from axisbus.motion.trajectory import Trajectory


class Guarded:
    """Holds a trajectory, and its ``duration`` as it was told once; what else it tells of itself only itself tells."""

    __slots__ = ("_name", "_trajectory", "duration")

    def __init__(self, trajectory: Trajectory, name: str) -> None:
        """``name``: the axis.

        Raises:
            ArgumentError: it tells no duration.
        """
        self._trajectory = trajectory
        self._name = name
        self.duration = self._ask(
            lambda: trajectory.duration,
            lambda: "duration",
            "mend its duration, which must give the same number always",
        )

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds.

        Raises:
            ArgumentError: it gives none.
        """
        return self._ask(
            lambda: self._trajectory.position(t),
            lambda: f"position at {t:.3f} s",
            "mend its position(t), which must give a number for every t from 0 to its duration; the axis was stopped",
        )

    def _ask(self, ask: Callable[[], object], what: Callable[[], str], remedy: str) -> float:
        """Return the number that the trajectory's own code gives; whatever else it does ends the command with its name.

        ``what`` says what was asked for, where that is to be told.
        """
        try:
            value = ask()
        except BaseException as error:
            if not is_own(error):
                raise
            raise ArgumentError(self._message(what), observed=in_a_line(error), remedy=remedy) from error
        found = number(value)
        if found is None:
            raise ArgumentError(self._message(what), observed=f"it gave {told(value)}", remedy=remedy)
        return found

    def _message(self, what: Callable[[], str]) -> str:
        return f"{self._name}: the trajectory gives no {what()}"
