"""The last command of a module, whether its motion follows it, and the errors of a motion that deviates; pure functions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.can_simple.states import state_words
from axisbus.drives.gim6010.modbus.module import ModbusModule, StatusRead
from axisbus.drives.gim6010.modbus.motion.ladder import STANDS, Halting, RampHalt, TrapezoidHalt
from axisbus.errors import (
    ArgumentError,
    DriveError,
    DriveFault,
    LimitError,
    MotionTimeout,
    StaleError,
    UncommandedMotion,
)

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


# -- The control mode and the last command -----------------------------------------------------------------------------


_WRONG: dict[ModbusMotionStatus, type[DriveError]] = {
    ModbusMotionStatus.TOO_FAST: UncommandedMotion,
    ModbusMotionStatus.AWAY: UncommandedMotion,
    ModbusMotionStatus.LATE: MotionTimeout,
    ModbusMotionStatus.BLIND: StaleError,
}


class ModbusControlMode(Enum):
    """The controlled quantity: the values of control mode and input mode (4.3.3)."""

    POSITION = (3, 5)
    VELOCITY = (2, 2)
    TORQUE = (1, 6)


@dataclass(slots=True)
class ModbusCommand:
    """The last command of this program; holds state.

    ``commanded``: velocity in turns/s or torque in N·m. ``target``: turns of the rotor. ``ramp``: turns/s² for braking, 0 if
    nothing was commanded. ``fastest``: the highest speed in turns/s that the motion can explain; in torque control, the highest
    allowed one.
    """

    control: ModbusControlMode
    commanded: float = 0.0
    target: float | None = None
    ramp: float = 0.0
    fastest: float = 0.0

    @property
    def halting(self) -> Halting | None:
        """The set-points that brake it in its own mode; None if that is not possible."""
        if not self.ramp or self.control is ModbusControlMode.TORQUE:
            return None
        if self.control is ModbusControlMode.POSITION:
            return None if self.target is None else TrapezoidHalt(self.ramp, self.target)
        return RampHalt(self.ramp, self.commanded)

    def is_too_fast(self, velocity: float) -> bool:
        """Whether a velocity is too high for the command."""
        if self.control is ModbusControlMode.TORQUE and self.fastest:
            return abs(velocity) > self.fastest
        return too_fast(velocity, self.fastest)

    @property
    def setpoint(self) -> float | None:
        """The commanded value, for messages."""
        return self.target if self.control is ModbusControlMode.POSITION else self.commanded


def fault(module: ModbusModule, state: int) -> DriveFault:
    """Return the error of a module that reports errors or is in an unrequested state; blocks while its error words are read."""
    errors = module.errors()
    return DriveFault(
        f"module {module.device} is in {state_words(state)}" + (" with errors" if errors.any else ""),
        observed="; ".join(errors.lines)
        or "its error words are 0: another program may have changed its state",
        remedy="remove the cause, then clear it: axisbus gim6010 modbus errors --clear",
    )


def wrong(
    module: ModbusModule, verdict: ModbusMotionStatus, seen: StatusRead, course: ModbusCommand
) -> DriveError:
    """Return the error of a motion that deviates from its command."""
    return _WRONG[verdict](
        f"module {module.device}: {verdict.value}",
        observed=f"at {turns(seen.position)}, velocity {told(seen.velocity)} turns/s, set-point {told(course.setpoint)}",
        remedy="check for a blocked or pulled load, low limits of current or velocity, and unsuitable gains",
    )


def require_positive(**values: float) -> None:
    """Check that these are finite and above 0.

    Raises:
        ArgumentError: one is not.
    """
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise ArgumentError(
                f"{name} = {value!r} is not a number above 0", remedy=f"give a {name} above 0"
            )


def require_finite(**values: float) -> None:
    """Check that these are numbers.

    Raises:
        ArgumentError: one is not.
    """
    for name, value in values.items():
        if not math.isfinite(value):
            raise ArgumentError(
                f"{name} = {value!r} is not a finite number", remedy=f"give a number for {name}"
            )


def require_torque(torque: float, most: float) -> None:
    """Check a torque against the highest that the caller allows (N·m).

    Raises:
        LimitError: it is more.
    """
    if abs(torque) > most:
        raise LimitError(
            f"{torque:g} N·m is beyond the limit of {most:g} N·m", remedy="command less, or allow more"
        )


def told(value: float | None) -> str:
    """Return a value as text."""
    return "unknown" if value is None else f"{value:.3f}"


def turns(value: float | None) -> str:
    """Return a position or a distance in turns of the rotor as text; None: unknown."""
    return "an unknown place" if value is None else f"{float(value):.4f} turns"
