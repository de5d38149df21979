"""The control mode and the last command of a module, and the errors of a motion that deviates from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.can_simple.states import state_words
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.motion.halting import Halting, RampHalt, TrapezoidHalt
from axisbus.drives.gim6010.modbus.motion.look import StatusRead
from axisbus.drives.gim6010.modbus.motion.watch import ModbusMotionStatus, too_fast
from axisbus.errors import (
    ArgumentError,
    DriveError,
    DriveFault,
    LimitError,
    MotionTimeout,
    StaleError,
    UncommandedMotion,
)

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
