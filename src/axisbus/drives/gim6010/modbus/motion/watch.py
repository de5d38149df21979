"""Whether a motion goes as it was asked for, by what is seen: arrived, under way, or what is wrong; pure functions of looks."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.modbus.motion.halting import STANDS
from axisbus.drives.gim6010.modbus.motion.look import StatusRead

_MORE = 1.2  # times as fast as asked for is too fast, and
_SPARE = 0.5  # turns/s of the rotor beside it
_STUCK = 2.0  # s without getting nearer


class ModbusMotionStatus(Enum):
    """How a motion stands."""

    UNDER_WAY = "under way"
    DONE = "as asked for"
    TOO_FAST = "it is faster than was asked for"
    AWAY = "it moves away from where it is to go"
    LATE = "it is not there in time"
    BLIND = "its position or velocity is no number"


def too_fast(speed: float, asked: float) -> bool:
    """Whether a speed is none that a motion of ``asked`` turns/s explains."""
    return abs(speed) > _MORE * abs(asked) + _SPARE


@dataclass(slots=True)
class MoveWatch:
    """A move from ``start`` to ``target`` (turns of the rotor) with at most ``velocity``; holds for how many looks it is there."""

    start: float
    target: float
    velocity: float
    window: float
    deadline: float  # s of the looks' clock
    _there: int = 0

    def judge(self, seen: StatusRead) -> ModbusMotionStatus:
        """Return how it stands by one more look."""
        if seen.position is None or seen.velocity is None:
            return ModbusMotionStatus.BLIND
        if too_fast(seen.velocity, self.velocity):
            return ModbusMotionStatus.TOO_FAST
        away = abs(self.target - seen.position)
        if away > abs(self.target - self.start) + max(self.window, 0.1):
            return ModbusMotionStatus.AWAY
        self._there = self._there + 1 if away <= self.window and abs(seen.velocity) <= STANDS else 0
        if self._there >= 2:
            return ModbusMotionStatus.DONE
        return ModbusMotionStatus.LATE if seen.at > self.deadline else ModbusMotionStatus.UNDER_WAY


@dataclass(slots=True)
class TurnWatch:
    """A velocity that is to be reached (turns/s of the rotor); ``fastest`` is what was commanded by now, with what was before."""

    velocity: float
    fastest: float
    _nearest: float | None = None
    _since: float = 0.0

    def judge(self, seen: StatusRead) -> ModbusMotionStatus:
        """Return how it stands by one more look."""
        if seen.velocity is None or seen.position is None:
            return ModbusMotionStatus.BLIND
        if too_fast(seen.velocity, self.fastest):
            return ModbusMotionStatus.TOO_FAST
        off = abs(self.velocity - seen.velocity)
        if off <= max(STANDS, 0.02 * abs(self.velocity)):
            return ModbusMotionStatus.DONE
        if self._nearest is None or off < self._nearest - STANDS:
            self._nearest, self._since = off, seen.at
        return ModbusMotionStatus.LATE if seen.at - self._since > _STUCK else ModbusMotionStatus.UNDER_WAY
