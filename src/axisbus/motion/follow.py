"""Following a trajectory in cyclic synchronous position mode: one target per cycle, taken by the drive at SYNC."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.cia402 import objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import DriveError, LimitError, MotionTimeout
from axisbus.motion.activity import Activity, ModeSwitch, Transfers, require_position
from axisbus.motion.gate import Gate
from axisbus.motion.image import Image
from axisbus.motion.order import Order
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.trajectory import Trajectory

START_TOLERANCE = 20  # increments between where the axis stands and where its trajectory begins
_ARRIVAL = 2.0  # seconds that the axis may need to come up with the last target
_OVERSPEED = 1.02


class PathClock:
    """The time along a trajectory. It advances by exactly one period per executed cycle, and can be slowed to a stop.

    Slowing time scales the velocity down and keeps the path: a group that is halted stays on its straight line.
    """

    __slots__ = ("_slope", "rate", "t")

    def __init__(self) -> None:
        self.t = 0.0
        self.rate = 1.0
        self._slope = 0.0

    def advance(self, period: float) -> None:
        """Go on by one cycle."""
        if self._slope:
            new = max(0.0, self.rate - self._slope * period)
            self.t += 0.5 * (self.rate + new) * period
            self.rate = new
        else:
            self.t += self.rate * period

    def brake(self, seconds: float) -> None:
        """Slow down to a stop within ``seconds`` (0: at once)."""
        if seconds <= 0:
            self.rate = 0.0
        self._slope = max(self._slope, 1.0 / seconds if seconds > 0 else 1.0)

    @property
    def braking(self) -> bool:
        """Whether it is slowing down or stopped."""
        return self._slope > 0

    @property
    def stopped(self) -> bool:
        """Whether time stands still."""
        return self.rate == 0.0


class Follow(Activity):
    """One axis on a trajectory: 60C2h and the mode first, then a target in each cycle; holds the last target."""

    mode = ModeOfOperation.CYCLIC_SYNC_POSITION

    def __init__(
        self,
        trajectory: Trajectory | None,
        parameters: AxisParameters,
        gate: Gate,
        clock: PathClock | None = None,
        brake_time: Callable[[], float] | None = None,
    ) -> None:
        """``trajectory`` None: the group sets it with ``begin`` while all wait at the gate, and advances its own ``clock``.

        ``brake_time`` gives the seconds in which the path may be braked from full speed; None derives them from the axis's speed
        and deceleration.
        """
        self._trajectory = trajectory
        self._parameters = parameters
        self._gate = gate
        self._brake_time = brake_time
        self._speed = 0.0
        self._own_clock = clock is None
        self.clock = clock or PathClock()
        self._mode = ModeSwitch(ModeOfOperation.CYCLIC_SYNC_POSITION, parameters)
        self._period = InterpolationPeriod(parameters)
        self._prepared = False
        self._running = False
        self._last: int | None = None
        self._arrive_by: float | None = None

    def step(self, image: Image, order: Order) -> bool:
        """Return True when the axis has come up with the trajectory's end."""
        if not self._prepare(image, order) or self._trajectory is None:
            return False
        if not self._running:
            self._start(image)
        elif self._own_clock:
            self.clock.advance(self._parameters.scan_period)
        order.halt = False
        order.target_position = self._target(image)
        if self.clock.t < self._trajectory.duration or self.clock.braking:
            return False
        return self._arrived(image)

    def reference(self, image: Image) -> int:
        """Return the position to start from, in increments: the demand, else the actual position."""
        if self._mode.reference is not None:
            return self._mode.reference
        return (
            image.demand
            if image.demand is not None
            else require_position(image, self._parameters.name, "csp")
        )

    def begin(self, trajectory: Trajectory) -> None:
        """Take the trajectory that the group has planned."""
        self._trajectory = trajectory

    def begin_braking(self) -> bool:
        """Begin to slow down along the path; False where no deceleration is known to do it with."""
        if self.clock.braking or not self._running:
            return True
        seconds = self._brake_time() if self._brake_time is not None else self._braking_time()
        if seconds is None:
            return False
        self.clock.brake(seconds)
        return True

    @property
    def at_rest(self) -> bool:
        """Whether the commanded motion stands still (before the start, or after braking)."""
        return not self._running or self.clock.stopped

    def cancel(self, order: Order) -> None:
        """Take back what is queued."""
        self._period.cancel(order)

    def _braking_time(self) -> float | None:
        defaults = self._parameters.defaults
        deceleration = defaults.deceleration or defaults.acceleration or self._parameters.limits.acceleration
        return None if not deceleration else self._speed / deceleration

    def _prepare(self, image: Image, order: Order) -> bool:
        require_position(image, self._parameters.name, "cyclic synchronous position mode")
        if not self._prepared:
            self._prepared = self._period.step(image, order) and self._mode.step(image, order)
        return self._prepared and self._gate.pass_through(self)

    def _start(self, image: Image) -> None:
        assert self._trajectory is not None
        units = self._parameters.units.position
        reference = self.reference(image)
        first = units.to_increments(self._trajectory.position(0.0)) + image.origin
        if abs(first - reference) > START_TOLERANCE:
            raise LimitError(
                f"{self._parameters.name}: the trajectory does not begin where the axis stands",
                observed=f"it begins at {units.to_units(first - image.origin):g} {units.unit}, the axis stands at "
                f"{units.to_units(reference - image.origin):g} {units.unit}",
                remedy="begin it at axis.position",
            )
        self._running = True
        self._last = reference

    def _target(self, image: Image) -> int:
        assert self._trajectory is not None
        assert self._last is not None
        units, limits = self._parameters.units, self._parameters.limits
        value = self._trajectory.position(min(self.clock.t, self._trajectory.duration))
        if limits.position is not None and not limits.position[0] <= value <= limits.position[1]:
            raise LimitError(
                f"{self._parameters.name}: the trajectory leaves the position limits",
                observed=f"{value:g} {units.position.unit} at {self.clock.t:.3f} s; allowed are {limits.position[0]:g} to "
                f"{limits.position[1]:g}",
                remedy="change the trajectory, or position_limits in cell.toml; the axis was stopped",
            )
        target = units.position.to_increments(value) + image.origin
        self._speed = abs(units.position.to_units(target - self._last)) / self._parameters.scan_period
        self._check_speed()
        self._last = target
        return target

    def _check_speed(self) -> None:
        limit = self._parameters.limits.velocity
        units = self._parameters.units.position
        rounding = abs(units.to_units(2)) / self._parameters.scan_period
        if limit is not None and self._speed > limit * _OVERSPEED + rounding:
            raise LimitError(
                f"{self._parameters.name}: the trajectory is faster than max_velocity",
                observed=f"{self._speed:g} {units.unit}/s at {self.clock.t:.3f} s; allowed are {limit:g}",
                remedy="slow the trajectory down, or raise max_velocity in cell.toml; the axis was stopped",
            )

    def _arrived(self, image: Image) -> bool:
        assert self._last is not None
        if self._arrive_by is None:
            self._arrive_by = image.now + _ARRIVAL
        window = self._parameters.position_window or START_TOLERANCE
        if image.position is not None and image.standstill and abs(image.position - self._last) <= window:
            return True
        if image.now > self._arrive_by:
            raise self._late(image, window)
        return False

    def _late(self, image: Image, window: int) -> MotionTimeout:
        assert self._last is not None
        name, units = self._parameters.name, self._parameters.units.position
        where = (
            "unknown"
            if image.position is None
            else f"{units.to_units(image.position - image.origin):g} {units.unit}"
        )
        return MotionTimeout(
            f"{name}: does not come up with the end of its trajectory, {units.to_units(self._last - image.origin):g} {units.unit}",
            axis=name,
            observed=f"position {where} after {_ARRIVAL:g} s; within {abs(units.to_units(window)):g} {units.unit} was expected",
            remedy="look whether the axis is blocked or badly tuned; position_window in [axes."
            + name
            + "] sets the tolerance",
        )


class InterpolationPeriod:
    """Sets 60C2h to the scan period and reads it back, before a cyclic mode; nothing to do where the drive has no 60C2h."""

    __slots__ = ("_parameters", "_read", "_wanted", "_write")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._wanted = interpolation_period(parameters.scan_period)
        index = objects.INTERPOLATION_TIME_PERIOD
        present = parameters.has(index)
        value, exponent = self._wanted
        self._write = Transfers([(index, 1, value), (index, 2, exponent)] if present else [], parameters)
        self._read = Transfers([(index, 1, None), (index, 2, None)] if present else [], parameters)

    def step(self, image: Image, order: Order) -> bool:
        """Return True when the drive interpolates over our period."""
        if not self._write.step(image, order) or not self._read.step(image, order):
            return False
        got = tuple(self._read.values.values())
        if got and got[0] * 10.0 ** got[1] != self._wanted[0] * 10.0 ** self._wanted[1]:
            name = self._parameters.name
            raise DriveError(
                f"{name}: the drive does not take the scan period as its interpolation time",
                axis=name,
                observed=f"60C2h was written as {self._wanted[0]} x 10^{self._wanted[1]} s and reads {got[0]} x 10^{got[1]} s",
                remedy="choose a scan_period in cell.toml that the drive can interpolate over (its manual lists them)",
            )
        return True

    def cancel(self, order: Order) -> None:
        """Take back what is queued."""
        self._write.cancel(order)
        self._read.cancel(order)


def interpolation_period(period: float) -> tuple[int, int]:
    """Return value and power of ten for 60C2h (value 1 to 255, seconds = value x 10^index).

    Raises:
        LimitError: the period cannot be said in that form.
    """
    for exponent in range(0, -7, -1):
        value = period * 10.0**-exponent
        if value >= 1 and abs(value - round(value)) < 1e-9 * value and round(value) <= 255:
            return round(value), exponent
    raise LimitError(
        f"a scan period of {period * 1000:g} ms cannot be written into 60C2h",
        observed="60C2h holds 1 to 255 times a power of ten",
        remedy='choose a period such as "2ms", "2.5ms" or "10ms"',
    )
