"""Whether a motion follows its command: arrived, under way, or a deviation; pure functions of readings."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.modbus.motion.halting import STANDS
from axisbus.drives.gim6010.modbus.motion.look import StatusRead

_MORE = 1.2  # times the commanded speed is too fast, plus
_SPARE = 0.5  # turns/s of the rotor
_STUCK = 2.0  # s without getting nearer


class ModbusMotionStatus(Enum):
    """The state of a motion."""

    UNDER_WAY = "under way"
    DONE = "done"
    TOO_FAST = "it is faster than commanded"
    AWAY = "it moves away from its target"
    LATE = "it has not arrived in time"
    BLIND = "its position or velocity is not a number"


def too_fast(speed: float, asked: float) -> bool:
    """Whether a speed is higher than a commanded speed of ``asked`` turns/s can explain."""
    return abs(speed) > _MORE * abs(asked) + _SPARE


@dataclass(slots=True)
class MoveWatch:
    """A move from ``start`` to ``target`` (turns of the rotor) with at most ``velocity``; counts the readings at the target."""

    start: float
    target: float
    velocity: float
    window: float
    deadline: float  # s, by the clock of the readings
    _there: int = 0

    def judge(self, seen: StatusRead) -> ModbusMotionStatus:
        """Return the state of the motion after one more reading."""
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
    """A velocity to reach (turns/s of the rotor); ``fastest`` is the highest of the present and the previous commands."""

    velocity: float
    fastest: float
    _nearest: float | None = None
    _since: float = 0.0

    def judge(self, seen: StatusRead) -> ModbusMotionStatus:
        """Return the state of the motion after one more reading."""
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
