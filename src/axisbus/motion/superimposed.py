"""A distance superimposed on an axis's path (MC_MoveSuperimposed), such that the sum stays within the limits of the axis.

Theory of operation
-------------------
The path continues unchanged, and in each cycle its next position is known before the superimposed motion advances. The rate of the
superimposed motion is chosen such that the sum exceeds neither the velocity nor the acceleration of the axis. So the superimposed
motion is slowed down, and waits if the path needs the whole limit. If the path alone is within the limits, there is always such
a rate: the present one, or one closer to 0. The superimposed motion never moves backwards, nor faster than requested, to compensate
for a path that exceeds the limits; the usual checks detect such a path.

To be able to brake when it must, the superimposed motion is limited in its ramps: they use the part of ``max_acceleration`` that a
path with a known highest acceleration leaves. If it overshoots its end, it returns automatically.
"""

from __future__ import annotations

import math

from axisbus.errors import AxisbusError, LimitError
from axisbus.motion.commands import MoveSuperimposed
from axisbus.motion.moves.profile import braking_distance
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_limit_check import PathLimitCheck, Ramped
from axisbus.motion.position_limits import LookaheadTrajectory, PositionRange
from axisbus.motion.trajectory import Trajectory


class Addition:
    """Holds the completed part of the distance, and the error that stops it; in units of the axis."""

    __slots__ = ("_is_halted", "_shift", "error", "factor", "is_admitted")

    def __init__(self, command: MoveSuperimposed, period: float) -> None:
        """``period``: scan period in seconds."""
        self._shift = Shift(period)
        self._shift.aim(command.distance, command.velocity, command.acceleration, command.deceleration)
        self._is_halted = False
        self.is_admitted = False  # set by the path's activity in the first cycle in which both move
        self.factor = 1.0  # the override
        self.error: AxisbusError | None = None

    @property
    def value(self) -> float:
        """The completed part of the distance."""
        return self._shift.value

    @property
    def distance(self) -> float:
        """The whole distance."""
        return self._shift.end

    @property
    def rate(self) -> float:
        """The present velocity in unit/s."""
        return self._shift.rate

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self._shift.rate == 0.0 if self._is_halted else self._shift.at_rest

    @property
    def hardest(self) -> float:
        """The higher one of its accelerations, in unit/s²."""
        return self._shift.hardest

    def continue_from(self, before: Addition) -> None:
        """Take over the rate of another superimposed motion, which this one replaces."""
        self._shift.rate = before.rate

    def soften(self, most: float) -> None:
        """Limit its ramps to ``most`` (unit/s²)."""
        self._shift.soften(most)

    def halt(self, error: AxisbusError | None = None, deceleration: float | None = None) -> None:
        """Brake to rest, by ``deceleration`` (unit/s²) if given; ``error``: the reason, unless the user has requested the halt."""
        self._is_halted = True
        self.error = self.error or error
        if deceleration is not None:
            self._shift.brake_by(deceleration)

    def rest(self, velocity: float, deceleration: float, cycles: float) -> float:
        """Return the axis's distance to rest if this motion brakes now, and then its path, by ``deceleration`` from ``velocity``.

        ``cycles``: seconds before braking takes effect.
        """
        time = self._shift.braking_time + cycles
        distance = math.copysign(braking_distance(velocity, deceleration), velocity)
        return (
            self._shift.braking
            + (self._shift.rate + velocity) * cycles
            + velocity * (time - cycles)
            + distance
        )

    def step(self, velocity: float, low: float, high: float) -> float:
        """Advance by one cycle and return the rate; the path moves at ``velocity``, the sum must be from ``low`` to ``high``."""
        shift = self._shift
        wanted, rate = shift.braked() if self._is_halted else shift.wanted(self.factor), shift.rate
        limited = min(max(wanted, low - velocity), high - velocity)
        shift.go(min(max(limited, min(0.0, rate, wanted)), max(0.0, rate, wanted)))
        return shift.rate


# ----------------------------------------------------------------------------------------------------------------------
# Whether the motion of an axis leaves room for a superimposed motion: of acceleration once, of position in each cycle.


_LEAST = 0.02  # of max_acceleration: with less it would take too long
_REACTION_CYCLES = 2.0  # cycles: a finding of this cycle takes effect in the next one


def admit(
    addition: Addition,
    path: Trajectory,
    shifted: float,
    parameters: AxisParameters,
    allowed: PositionRange | None,
) -> None:
    """Limit the addition's ramps to the acceleration that ``path``, which is already shifted by ``shifted`` (units), leaves.

    ``allowed``: the permitted range of the axis; without position limits, the range of its drive's count.

    Raises:
        LimitError: the path leaves too little acceleration, or the sum is known to leave the position limits or the drive's count.
    """
    name, unit = parameters.name, parameters.units.position.unit
    limit = parameters.limits.acceleration
    if limit is not None and isinstance(path, Ramped):
        left = limit - path.top_acceleration
        if left < _LEAST * limit:
            raise LimitError(
                f"{name}: its present motion needs all of max_acceleration, so no distance can be superimposed",
                observed=f"it needs {path.top_acceleration:g} {unit}/s², the limit is {limit:g}",
                remedy=f"give the present motion of {name} less acceleration, or raise max_acceleration in [axes.{name}] of "
                "cell.toml",
            )
        addition.soften(left)
    limits = parameters.limits.position or allowed
    if limits is None or not isinstance(path, LookaheadTrajectory):
        return
    low, high = (edge + shifted for edge in path.span)
    reach = addition.distance + low if addition.distance < 0.0 else addition.distance + high
    margin = abs(parameters.units.position.to_units(1))
    if not limits[0] - margin <= reach <= limits[1] + margin:
        raise LimitError(
            f"{name}: its present motion with the superimposed distance would leave "
            + (
                "the drive's position range (INTEGER32)"
                if parameters.limits.position is None
                else "the position limits"
            ),
            observed=f"the present motion is from {low:g} to {high:g} {unit}, the sum reaches {reach:g}; the allowed range is "
            f"{limits[0]:g} to {limits[1]:g}",
            remedy=f"superimpose a shorter distance, or change position_limits in [axes.{name}] of cell.toml",
        )


def look_ahead(
    addition: Addition,
    here: float,
    velocity: float,
    limit_check: PathLimitCheck,
    limits: tuple[float, float],
    parameters: AxisParameters,
) -> LimitError | None:
    """Return why a superimposed motion must brake now so that the axis, at ``here``, can still stop within its limits.

    ``velocity``: velocity of the path. Only the direction of the superimposed motion is checked.
    """
    deceleration = parameters.path_deceleration
    if not deceleration:
        return None
    rest = here + addition.rest(velocity, deceleration, _REACTION_CYCLES * limit_check.period)
    if not (addition.rate > 0.0 and rest > limits[1]) and not (addition.rate < 0.0 and rest < limits[0]):
        return None
    name, unit = parameters.name, parameters.units.position.unit
    return LimitError(
        f"{name}: the superimposed distance would move the axis beyond its position limits",
        observed=f"{addition.value:g} of {addition.distance:g} {unit} are done; it would stop at {rest:g} {unit}; the "
        f"allowed range is {limits[0]:g} to {limits[1]:g}",
        remedy=f"superimpose a shorter distance, or change position_limits in [axes.{name}] of cell.toml; the superimposed "
        "motion was braked, and the motion under it continues",
    )


# -- A distance covered from cycle to cycle, on ramps, while another motion continues; any cycle may slow it down ------
#
# Theory of operation
# In each cycle the rate approaches the requested rate by no more than its ramp, and stays low enough to be at rest at the end. A
# position is the previous one plus the rate times the period. Let d be the deceleration, T the period, w a rate in units of d T,
# and k the whole number below w. When braking, the rate w is followed by w - 1, w - 2 and so on. Together these cycles cover (k +
# 1) w - k (k + 1) / 2 units of d T². ``_bound`` is the rate for which this equals the remaining distance. One cycle later it is
# lower by one, and in the last cycle it reaches the end.
#
# A motion that is slowed down while it should brake overshoots its end, and returns to it.


_NEAR = 1e-12  # relative to the larger number: the resolution of the numbers


class Shift:
    """Holds the covered part of a distance (``value``), its velocity (``rate``, per s), and its end."""

    __slots__ = ("_down", "_period", "_up", "_velocity", "end", "rate", "value")

    def __init__(self, period: float) -> None:
        """``period``: scan period in seconds."""
        self.value = self.rate = self.end = 0.0
        self._period = period
        self._velocity = self._up = self._down = 0.0

    def aim(self, end: float, velocity: float, up: float, down: float) -> None:
        """Move to ``end`` from the present rate, by at most ``velocity`` (per s), ``up`` and ``down`` (per s²), all above 0."""
        self.end, self._velocity, self._up, self._down = end, velocity, up, down

    def brake_by(self, down: float) -> None:
        """Set the deceleration to ``down`` (per s²)."""
        self._down = down

    @property
    def hardest(self) -> float:
        """The higher one of its ramps."""
        return max(self._up, self._down)

    def soften(self, most: float) -> None:
        """Limit the ramps to ``most`` (per s²)."""
        self._up, self._down = min(self._up, most), min(self._down, most)

    @property
    def at_rest(self) -> bool:
        """Whether it is at its end, and no longer changes."""
        return self.rate == 0.0 and self.value == self.end

    @property
    def braking(self) -> float:
        """The signed distance to rest if it brakes now."""
        return 0.5 * self.rate * abs(self.rate) / self._down

    @property
    def braking_time(self) -> float:
        """Seconds to rest if it brakes now."""
        return abs(self.rate) / self._down

    def wanted(self, factor: float = 1.0) -> float:
        """Return the rate of the next cycle at ``factor`` times the velocity; changes nothing."""
        left = self.end - self.value
        return self._nearer(math.copysign(min(self._bound(abs(left)), self._velocity * factor), left))

    def braked(self) -> float:
        """Return the rate of the next cycle when braking to rest; changes nothing."""
        return self._nearer(0.0)

    def go(self, rate: float) -> None:
        """Advance by one cycle with ``rate``."""
        self.rate = rate
        self.value += rate * self._period
        if abs(self.end - self.value) <= _NEAR * max(abs(self.end), abs(self.value)):
            self.value = self.end

    def _bound(self, left: float) -> float:
        """Return the highest rate of the next cycle with which it can come to rest after distance ``left``."""
        change = self._down * self._period
        length = left / (change * self._period)
        k = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * length) - 1.0))
        return change * (length / (k + 1) + 0.5 * k)

    def _nearer(self, target: float) -> float:
        """Return ``target``, or the rate closest to it that the ramps permit after one cycle."""
        rate, up, down = self.rate, self._up * self._period, self._down * self._period
        if rate * target < 0.0:
            target = 0.0
        if abs(target) > abs(rate):
            return target if abs(target) - abs(rate) <= up else math.copysign(abs(rate) + up, target)
        return target if abs(rate) - abs(target) <= down else math.copysign(abs(rate) - down, rate)
