"""Convert the arguments of a call from units to increments, checked against the axis's limits and the objects' ranges."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

from axisbus.cia301.datatypes import DataType, check_range
from axisbus.errors import ArgumentError, LimitError
from axisbus.motion.blending.mode import BufferMode
from axisbus.motion.commands import CyclicVelocity, MoveSuperimposed
from axisbus.motion.jerk.drive_profile_type import has_jerk_objects
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.numbers import flag, items, number, short_repr
from axisbus.motion.override import MAX_OVERRIDE
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_limit_check import Ramped, limit_check_of
from axisbus.motion.point_stream.curve_fit import STILL
from axisbus.motion.position_limits import LookaheadTrajectory, widened
from axisbus.motion.trajectory import Trajectory
from axisbus.units import Scale, toward_zero, whole_above, whole_below

_COUNTABLE = 2.0**63  # increments: no object can hold more
_HOLD_TO_RUN_TIMES = 0.05, 60.0  # seconds: the shortest is a few cycles; a longer time protects nothing
_ROUNDING = 1.000001  # relative tolerance for a computed velocity, acceleration or torque


def shown(value: object) -> str:
    """Return a number as a call would show it; any other value as Python does."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return short_repr(value)
    try:
        return f"{float(value):g}"
    except Exception:  # noqa: BLE001  # larger than any float
        return short_repr(value)


def flag_of(call: str, what: str, value: object) -> bool:
    """Return a bool; raises ArgumentError for anything else. ``call`` names the call in the message."""
    found = flag(value)
    if found is None:
        raise ArgumentError(
            f"{call}: {what} {short_repr(value)} is neither True nor False",
            remedy=f"give {what} as True or False",
        )
    return found


def items_of(call: str, what: str, values: object) -> tuple[Any, ...]:
    """Return the items of a sequence; raises ArgumentError for anything else. ``call`` names the call in the message."""
    found = items(values)
    if found is None:
        raise ArgumentError(
            f"{call}: {short_repr(values)} is not a sequence of {what}",
            remedy=f"give the {what} in a list or tuple",
        )
    return found


def override_of(call: str, factor: float) -> float:
    """Return an override, 0 to 1.5; ``call`` names the call in the message.

    Raises:
        ArgumentError: it is out of range, or no number.
    """
    found = number(factor)
    if found is None or not 0.0 <= found <= MAX_OVERRIDE:
        raise ArgumentError(
            f"{call}({short_repr(factor)}): an override must be a number from 0 to {MAX_OVERRIDE:g}",
            remedy="1 is the velocity of the command; 0 holds the motion on its path",
        )
    return found


def hold_of(call: str, seconds: float) -> float:
    """Return the time that a program may be silent, 0.05 to 60 s; ``call`` names the call in the message.

    Raises:
        ArgumentError: it is out of range, or no number.
    """
    found = number(seconds)
    if found is None or not _HOLD_TO_RUN_TIMES[0] <= found <= _HOLD_TO_RUN_TIMES[1]:
        raise ArgumentError(
            f"{call}({short_repr(seconds)}): that is not a time from {_HOLD_TO_RUN_TIMES[0]:g} to {_HOLD_TO_RUN_TIMES[1]:g} s",
            remedy="give several times the interval between two calls; None ends it",
        )
    return found


def buffering_of(call: str, buffer: bool | str) -> BufferMode | None:
    """Return PLCopen's BufferMode of a motion; None is *Aborting*: it replaces the previous motion.

    Raises:
        ArgumentError: ``buffer`` is none of the modes; ``call`` names the call in the message.
    """
    if isinstance(buffer, bool):
        return BufferMode.BUFFERED if buffer else None
    try:
        return BufferMode(buffer)
    except ValueError:
        raise ArgumentError(
            f"{call}: buffer {short_repr(buffer)} is not a buffer mode",
            remedy=f"give True or one of {', '.join(mode.value for mode in BufferMode)}; or leave it out: then the present "
            "motion is replaced",
        ) from None


class AxisCall:
    """Converts one call, such as ``x.move_absolute(90 deg)``, from units to increments.

    All methods raise ArgumentError for a missing or non-numeric value, and LimitError for a value beyond a limit. The text of the
    error names the call.
    """

    def __init__(self, parameters: AxisParameters, name: str) -> None:
        self._parameters = parameters
        self._unit = parameters.units.position.unit
        self.text = f"{parameters.name}.{name}"

    # -- single values -----------------------------------------------------------------------------------------------

    def finite(self, what: str, value: float, unit: str | None = None) -> float:
        """Return ``value``, which must be a finite number."""
        found = number(value)
        if found is None:
            raise ArgumentError(
                f"{self.text}: {what} {short_repr(value)} is not a finite number",
                remedy=f"give {what} as a number in {self._unit if unit is None else unit}, and check the computation of "
                "this value",
            )
        return found

    def positive(self, what: str, value: float, unit: str | None = None) -> float:
        """Return ``value``, which must be above 0."""
        magnitude = self.finite(what, value, unit)
        if magnitude <= 0:
            raise ArgumentError(
                f"{self.text}: {what} {magnitude:g} must be above 0",
                remedy=f"give {what} as a magnitude in {self._unit if unit is None else unit}",
            )
        return magnitude

    def timeout(self, value: float | None) -> float | None:
        """Return a time in seconds; None if it is left out."""
        return None if value is None else self.positive("timeout", value, "s")

    def target(self, position: float) -> int:
        """Return an absolute position, within the axis's limits, in increments."""
        limits, scale = self._parameters.limits.position, self._parameters.units.position
        if limits is not None and not limits[0] <= position <= limits[1]:
            raise LimitError(
                f"{self.text}: beyond the position limits",
                observed=f"the allowed range is {limits[0]:g} to {limits[1]:g} {self._unit}",
                remedy=f"give a position within them, or change position_limits in [axes.{self._parameters.name}] of cell.toml",
            )
        self._countable(position * scale.factor, DataType.INTEGER32, "607Ah")
        raw = scale.to_increments(position)
        if limits is not None:  # rounding may leave the limits
            low, high = sorted(edge * scale.factor for edge in limits)
            raw = min(max(raw, whole_above(low)), whole_below(high))
        return self._fits(raw, DataType.INTEGER32, "607Ah")

    def checked_position(self, position: float) -> int:
        """Return the value for the actual position (``set_position``), in increments."""
        value = self.finite("position", position) * self._parameters.units.position.factor
        return self._fits(
            round(self._countable(value, DataType.INTEGER32, "6064h")), DataType.INTEGER32, "6064h"
        )

    def distance(self, distance: float) -> int:
        """Return a distance in increments."""
        value = self.finite("distance", distance) * self._parameters.units.position.factor
        return self._fits(
            round(self._countable(value, DataType.INTEGER32, "607Ah")), DataType.INTEGER32, "607Ah"
        )

    def torque(self, torque: float, object_text: str = "6071h") -> int:
        """Return a torque (N·m, signed) in 0.1 % of rated torque."""
        limits, requested = self._parameters.limits, self.finite("torque", torque, "N·m")
        torque = self._within("torque", requested, "N·m", limits.torque_key, limits.torque)
        self._countable(torque / self._rated_torque * 1000, DataType.INTEGER16, object_text)
        return self._fits(
            toward_zero(torque / self._rated_torque * 1000),
            DataType.INTEGER16,
            object_text,
        )

    def torque_offset(self, torque: float) -> int:
        """Return the constant torque of feed-forward in 0.1 % of rated torque; the cell file must configure 60B2h."""
        given = self._parameters.feed_forward
        if given is None or not given.by_torque:
            name = self._parameters.name
            raise ArgumentError(
                f"{self.text}: the torque offset (60B2h) of {name} is not sent",
                observed=f"[axes.{name}.feed_forward] of cell.toml has neither inertia nor torque_offset",
                remedy=f"write torque_offset = 0.0 into [axes.{name}.feed_forward], and open the machine again",
            )
        return self.torque(torque, "60B2h")

    def torque_slope(self, slope: float | None) -> int | None:
        """Return a slope (N·m/s) in 0.1 % of rated torque per second; None if neither the call nor the defaults give one.

        The drive's own slope then applies, unless it is 0: with 0 some drives never build up torque, others at once.
        """
        slope = slope if slope is not None else self._parameters.defaults.torque_slope
        if slope is None:
            self._require_own_slope()
            return None
        raw = self.positive("slope", slope, "N·m/s") / abs(self._rated_torque) * 1000
        self._countable(raw, DataType.UNSIGNED32, "6087h")
        return self._fits(round(raw), DataType.UNSIGNED32, "6087h")

    def cyclic_slope(self, slope: float | None) -> int:
        """Return the slope (N·m/s) that the master makes, in 0.1 % of rated torque per second, above 0.

        If neither the call nor the defaults give one, it is the drive's own (6087h), if that is not 0.
        """
        raw = self.torque_slope(slope)
        own = self._parameters.torque_slope if raw is None else raw
        if own is None:
            raise self.missing("slope", "torque_slope in N·m/s", "defaults")
        if not own:
            raise LimitError(
                f"{self.text}: slope {short_repr(slope)} N·m/s is less than 0.1 % of rated torque per second",
                observed=f"the rated torque is {abs(self._rated_torque):g} N·m",
                remedy="give a steeper slope",
            )
        return own

    def _require_own_slope(self) -> None:
        if self._parameters.torque_slope != 0:
            return
        name = self._parameters.name
        raise ArgumentError(
            f"{self.text}: slope is missing",
            observed="the drive's own torque slope (6087h) is 0: some drives never change their torque then, others at once",
            remedy=f"give slope = ... (N·m/s) in the call, or torque_slope in [axes.{name}.defaults]; it is never guessed",
        )

    @property
    def _rated_torque(self) -> float:
        rated = self._parameters.units.rated_torque
        if self._parameters.virtual:
            raise self._no_drive("no torque", "use a position or velocity command")
        if rated is None:
            raise self.missing("rated_torque", "the axis's rated torque in N·m", in_call=False)
        return rated

    def homing_method(self, method: int | None) -> int:
        """Return a method of 6098h."""
        if self._parameters.virtual:
            raise self._no_drive("no drive that could be homed", "give its position: axis.set_position(...)")
        method = self._parameters.homing.method if method is None else method
        if method is None:
            raise self.missing("method", "a homing method of 6098h", "homing")
        found = self.finite("method", method, "a method of 6098h")
        if found != int(found):
            raise ArgumentError(
                f"{self.text}: method {found:g} is not a whole number", remedy="give a method of 6098h"
            )
        return self._fits(int(found), DataType.INTEGER8, "6098h")

    def homing_speed(self, key: str, value: float | None, needed: bool) -> int | None:
        """Return a homing speed of ``[axes.NAME.homing]`` in the drive's increments."""
        if value is None:
            if needed:
                raise self.missing(key, f"the homing speed in {self._unit}/s", "homing", in_call=False)
            return None
        return self._raw(self._parameters.units.velocity, value, "6099h")

    def homing_acceleration(self, value: float | None) -> int | None:
        """Return the homing acceleration of ``[axes.NAME.homing]`` in the drive's increments."""
        return None if value is None else self._raw(self._parameters.units.acceleration, value, "609Ah")

    # -- profiles ----------------------------------------------------------------------------------------------------

    def profile(
        self,
        velocity: float | None,
        acceleration: float | None = None,
        deceleration: float | None = None,
        timeout: float | None = None,
        jerk: float | None = None,
    ) -> MoveProfile:
        """Return the profile of a move to a position; missing values are those of the defaults. An infinite jerk is no limit."""
        speed = self._speed(velocity)
        raw = self._raw(self._parameters.units.velocity, speed, "6081h")
        return self._softened(self._with_ramps(raw, speed, acceleration, deceleration, timeout), jerk)

    def _softened(self, profile: MoveProfile, jerk: float | None) -> MoveProfile:
        """Return the profile with a jerk limit. If the drive limits it, 60A4h is in acceleration increments per second."""
        jerk = self._parameters.defaults.jerk if jerk is None else jerk
        if jerk is None or (isinstance(jerk, float) and jerk == math.inf):
            return profile
        soft = self.positive("jerk", jerk, f"{self._unit}/s³")
        raw = None
        if has_jerk_objects(self._parameters):
            raw = self._raw(self._parameters.units.acceleration, soft, "60A4h")
        return profile._replace(softness=soft, jerk=raw)

    def turning(
        self,
        velocity: float,
        acceleration: float | None = None,
        deceleration: float | None = None,
        timeout: float | None = None,
        jerk: float | None = None,
    ) -> MoveProfile:
        """Return the profile of a signed velocity; an infinite jerk is no limit."""
        velocity = self._velocity(self.finite("velocity", velocity, f"{self._unit}/s"))
        raw = self._turn(velocity)
        return self._softened(self._with_ramps(raw, abs(velocity), acceleration, deceleration, timeout), jerk)

    def _turn(self, velocity: float) -> int:
        """Return a signed velocity in increments of 60FFh, rounded towards 0."""
        raw = velocity * self._parameters.units.velocity.factor
        self._countable(raw, DataType.INTEGER32, "60FFh")
        return self._fits(toward_zero(raw), DataType.INTEGER32, "60FFh")

    def cyclic_velocity(
        self, velocity: float, acceleration: float | None, deceleration: float | None
    ) -> CyclicVelocity:
        """Return a signed velocity and its ramps. The master makes the ramps, so the velocity scale must be known."""
        velocity = self._velocity(self.finite("velocity", velocity, f"{self._unit}/s"))
        up, down = self._magnitudes(acceleration, deceleration)
        scale = self._parameters.units.velocity
        if not self._parameters.units.ratio_known:
            what = f"velocity increments per {self._unit}/s, which every ramp needs"
            raise self.missing("velocity_scale", what, in_call=False)
        return CyclicVelocity(self._turn(velocity), abs(up * scale.factor), abs(down * scale.factor))

    def superimposed(
        self, distance: float, velocity: float | None, acceleration: float | None, deceleration: float | None
    ) -> MoveSuperimposed:
        """Return a distance to be added to a motion, with its velocity and ramps; missing values are those of the defaults."""
        self.distance(distance)  # checks the range of the position object
        speed = self._speed(velocity)
        return MoveSuperimposed(float(distance), speed, *self._magnitudes(acceleration, deceleration))

    def _speed(self, value: float | None) -> float:
        """Return a speed in unit/s, by default the axis's, within the limit (with a tolerance for rounding)."""
        return self._velocity(
            self.positive("velocity", self._or_default("velocity", value), f"{self._unit}/s")
        )

    def _velocity(self, value: float) -> float:
        """Return a signed velocity in unit/s, within the limit (with a tolerance for rounding)."""
        return self._within(
            "velocity", value, f"{self._unit}/s", "max_velocity", self._parameters.limits.velocity
        )

    def _within(self, what: str, value: float, unit: str, key: str, limit: float | None) -> float:
        """Return ``value`` limited to ±``limit``; raises LimitError if it is larger by more than rounding."""
        if limit is None or abs(value) <= limit:
            return value
        if abs(value) > limit * _ROUNDING:
            raise self._beyond(what, value, unit, key, limit)
        return math.copysign(limit, value)

    def _with_ramps(
        self,
        raw: int,
        speed: float,
        acceleration: float | None,
        deceleration: float | None,
        timeout: float | None,
    ) -> MoveProfile:
        raw_up, raw_down = self._ramps(acceleration, deceleration)
        timeout, units = self.timeout(timeout), self._parameters.units
        if not units.ratio_known:
            return MoveProfile(raw, raw_up, raw_down, None, None, timeout)
        inc = abs(units.position.factor)
        up, down = (abs(units.acceleration.to_units(ramp)) * inc for ramp in (raw_up, raw_down))
        return MoveProfile(raw, raw_up, raw_down, speed * inc, min(up, down), timeout, up, down)

    def _ramps(self, acceleration: float | None, deceleration: float | None) -> tuple[int, int]:
        """Return acceleration and deceleration in the drive's increments."""
        up, down = self._magnitudes(acceleration, deceleration)
        scale = self._parameters.units.acceleration
        return self._raw(scale, up, "6083h"), self._raw(scale, down, "6084h")

    def _magnitudes(self, acceleration: float | None, deceleration: float | None) -> tuple[float, float]:
        """Return acceleration and deceleration in unit/s², within the limit."""
        unit = f"{self._unit}/s²"
        up = self.positive("acceleration", self._or_default("acceleration", acceleration), unit)
        down = deceleration if deceleration is not None else self._parameters.defaults.deceleration
        down = up if down is None else self.positive("deceleration", down, unit)
        return self._acceleration(up), self._acceleration(down)

    def acceleration(self, value: float | None) -> float:
        """Return an acceleration in unit/s², by default the axis's.

        Raises:
            LimitError: it is not above 0, or beyond ``max_acceleration``.
            ArgumentError: neither is given.
        """
        found = self.positive("acceleration", self._or_default("acceleration", value), f"{self._unit}/s²")
        return self._acceleration(found)

    def _acceleration(self, value: float) -> float:
        """Return an acceleration in unit/s², within the limit (with a tolerance for rounding)."""
        limit = self._parameters.limits.acceleration
        return self._within("acceleration", value, f"{self._unit}/s²", "max_acceleration", limit)

    def _or_default(self, what: str, value: float | None) -> float:
        if value is not None:
            return value
        default: float | None = getattr(self._parameters.defaults, what)
        if default is None:
            raise self.missing(what, f"the default {what}", "defaults")
        return default

    # -- trajectories ------------------------------------------------------------------------------------------------

    def trajectory(self, trajectory: Trajectory) -> None:
        """Check the duration of a trajectory, and its range and velocity if they are known in advance."""
        self.finite("the trajectory's duration", trajectory.duration, "s")
        limits = self._parameters.limits
        self._check_limits_known(trajectory)
        if isinstance(trajectory, LookaheadTrajectory):
            if limits.position is not None:
                self._check_range(trajectory.span, trajectory.position(0.0), limits.position)
            self._velocity(trajectory.top_speed)
        elif limits.position is not None and self._parameters.path_deceleration is None:
            what = "the acceleration with which it is braked ahead of position_limits"
            raise self.missing("acceleration", what, "defaults", in_call=False)

    def streamed(self) -> None:
        """Check that an axis can be braked along a stream of points, and that a jump of a point could be detected.

        Raises:
            ArgumentError: its braking deceleration or its maximum velocity is unknown.
        """
        if self._parameters.path_deceleration is None:
            what = "the acceleration with which it is braked if no point comes in time"
            raise self.missing("acceleration", what, "defaults", in_call=False)
        self._check_limits_known(STILL)

    def coupled(self) -> None:
        """Check that a slave can be braked without its master.

        Raises:
            ArgumentError: its braking deceleration is unknown.
        """
        if self._parameters.path_deceleration is None:
            what = "the acceleration with which it is braked when its master is lost"
            raise self.missing("acceleration", what, "defaults", in_call=False)

    def _check_limits_known(self, trajectory: Trajectory) -> None:
        """Check the acceleration against the limit if it is known in advance. Refuse if no limit would detect a jump."""
        if isinstance(trajectory, Ramped):
            self._acceleration(trajectory.top_acceleration)
        limit_check = limit_check_of(self._parameters, trajectory)
        if limit_check.velocity is None and limit_check.acceleration is None:
            what = f"the highest velocity of the axis, in {self._unit}/s, with which a jump of the trajectory is detected"
            raise self.missing("max_velocity", what, in_call=False)

    def _check_range(self, span: tuple[float, float], start: float, limits: tuple[float, float]) -> None:
        """Check the range of a trajectory against the limits; a trajectory that starts outside may return."""
        margin = abs(self._parameters.units.position.to_units(1))
        low, high = widened(limits, start, margin)
        if low <= span[0] and span[1] <= high:
            return
        raise LimitError(
            f"{self.text}: the trajectory leaves the position limits",
            observed=f"it reaches from {span[0]:g} to {span[1]:g} {self._unit}; "
            f"the allowed range is {limits[0]:g} to {limits[1]:g}",
            remedy=f"change the trajectory, or position_limits in [axes.{self._parameters.name}] of cell.toml",
        )

    # -- helpers -----------------------------------------------------------------------------------------------------

    def _raw(self, scale: Scale, value: float, what: str) -> int:
        """Return a magnitude in increments, rounded towards 0, that fits UNSIGNED32."""
        raw = toward_zero(abs(self._countable(value * scale.factor, DataType.UNSIGNED32, what)))
        if not raw:
            raise LimitError(
                f"{self.text}: {value:g} {scale.unit} is less than one increment of the drive ({what})",
                observed=f"its smallest step is {abs(scale.to_units(1)):g} {scale.unit}, which is more than the command",
                remedy="command at least that, or set a finer unit in the drive (60A9h, or the manufacturer's object)",
            )
        return self._fits(raw, DataType.UNSIGNED32, what)

    def _countable(self, increments: float, data_type: DataType, what: str) -> float:
        """Return computed increments; raises LimitError for values with more digits than a float has, which fit no object."""
        if abs(increments) < _COUNTABLE:
            return increments
        low, high = data_type.range
        raise LimitError(
            f"{self.text}: {what}: {increments:g} does not fit {data_type.name}",
            observed=f"{data_type.name} holds {low} to {high}",
            remedy="give a smaller value, or check the scale",
        )

    def _fits(self, value: int, data_type: DataType, what: str) -> int:
        return check_range(value, data_type, f"{self.text}: {what}")

    def missing(self, key: str, what: str, table: str = "", *, in_call: bool = True) -> ArgumentError:
        """Return the error of a missing value; ``in_call``: whether the call has an argument for it."""
        name = self._parameters.name
        where = f"[axes.{name}.{table}]" if table else f"[axes.{name}]"
        return ArgumentError(
            f"{self.text}: {key} is missing",
            observed=f"the call does not give it, and {where} in cell.toml does not either"
            if in_call
            else f"{where} in cell.toml does not give it",
            remedy=f"give {key} = ... in the call, or {what} in {where}; it is never guessed"
            if in_call
            else f"write {key} = ... ({what}) in {where}; it is never guessed",
        )

    def _no_drive(self, what: str, remedy: str) -> ArgumentError:
        return ArgumentError(
            f"{self.text}: {self._parameters.name} is virtual: it has {what}",
            observed="only the core moves it: there is no node and no drive",
            remedy=remedy,
        )

    def _beyond(self, what: str, value: float, unit: str, key: str, limit: float) -> LimitError:
        return LimitError(
            f"{self.text}: {what} {value:g} {unit} is beyond the limit",
            observed=f"{key} is {limit:g} {unit}",
            remedy=f"give a smaller value, or raise {key} in [axes.{self._parameters.name}] of cell.toml",
        )
