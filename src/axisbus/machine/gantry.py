"""The public pair of axes that carry one beam: enabled, homed, moved and stopped together."""

from __future__ import annotations

import itertools
from collections.abc import Callable

from axisbus.cia402.touch_probe import Edge
from axisbus.errors import ArgumentError, LimitError, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.axis_set import AxisSet
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.handle import Handle
from axisbus.machine.probing import require_objects
from axisbus.machine.request import AxisCall, buffering_of, flag_of, shown
from axisbus.motion.commands import TargetReference
from axisbus.motion.gantry import commands as g
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.group.commands import GroupContinue
from axisbus.motion.numbers import short_repr
from axisbus.motion.parameters import AxisLimits, AxisParameters, Defaults

_keys = itertools.count(1)


class Gantry(AxisSet):
    """Two axes that carry one beam; the beam's position is that of the first axis. Each command returns one ``Handle`` for both.

    The master commands both axes with one set-point in csp, within the lower of their limits. It monitors the skew of the beam in
    every cycle: beyond ``max_skew`` both axes are stopped along their path. The axes cannot be moved individually, except by
    ``square``. ``reset`` is refused while an enabled beam is out of square: disable it first. In ``quick_stop`` each drive uses its
    own ramp (605Ah, 6085h): configure the same ramp in both.
    """

    def __init__(
        self, parameters: GantryParameters, first: Axis, second: Axis, commanding: CommandDispatcher
    ) -> None:
        super().__init__(parameters.name, {axis.name: axis for axis in (first, second)}, commanding)
        self._pair = parameters
        self._first, self._second = first, second

    # -- position ------------------------------------------------------------------------------------------------------

    @property
    def unit(self) -> str:
        """The unit of its positions, that of both axes."""
        return self._first.unit

    @property
    def position(self) -> float:
        """Position of the beam: the actual position of its first axis, in its unit; raises StaleError if it is unknown."""
        return self._first.position

    @property
    def max_skew(self) -> float:
        """The largest allowed skew of the beam, in units."""
        return self._pair.max_skew

    @property
    def skew(self) -> float:
        """Skew of the beam in units: position of the second axis minus that of the first, minus the offset.

        Raises:
            StateError: the axes are not homed, so the skew is unknown.
            StaleError: a position is unknown.
        """
        if not self.homed:
            raise StateError(
                f"{self.name}: the skew of the beam is unknown",
                observed="its axes are not homed",
                remedy=f"home the pair first: {self.name}.home(), or set_position(...)",
            )
        return self._second.position - self._first.position - self._pair.offset

    @property
    def homed(self) -> bool:
        """Whether the positions of both axes are confirmed: homed, set, or of absolute encoders (``required = false``)."""
        facts = self._commanding.session.axes
        return all(axis.homed or not facts[axis.name].parameters.homing.required for axis in self)

    # -- power and stopping --------------------------------------------------------------------------------------------

    def enable(self, *, skew: float | None = None) -> Handle:
        """Switch both power stages on in one SYNC (MC_Power). Neither axis jumps, even if they push against each other.

        If the skew is larger than ``max_skew``, the command is refused: the handle ends with a SkewError that contains the figures.
        ``skew`` (units, above ``max_skew``) allows enabling up to this skew, which is then monitored, so that the beam can be made
        square. Until ``square`` has done so, no other command moves it. Does not block.

        Raises:
            ArgumentError: ``skew`` is not a number above ``max_skew``.
        """
        if skew is None:
            return self._submit("enable()", g.GantryEnable(self._pair.axes))
        request = self._request("enable")
        bound = request.distance(request.positive("skew", skew))
        if bound <= self.max_skew:
            raise LimitError(
                f"{self.name}.enable: skew {bound:g} {self.unit} is not above max_skew = {self.max_skew:g} {self.unit}",
                remedy="leave skew out: max_skew then applies",
            )
        return self._submit(f"enable(skew={bound:g} {self.unit})", g.GantryEnable(self._pair.axes, bound))

    # -- motion --------------------------------------------------------------------------------------------------------

    def move_absolute(
        self,
        position: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        jerk: float | None = None,
        buffer: bool = False,
    ) -> Handle:
        """Move the beam to ``position`` (MC_MoveAbsolute), from rest; it ends square: the second axis is at that plus the offset.

        Missing values are the smaller of the axes' defaults; ``jerk`` as ``Group.move_linear``. Does not block. With ``buffer`` the
        move begins when the pair's present command has ended successfully.

        Raises:
            LimitError: beyond the limits of either axis.
            ArgumentError: not finite, not positive, a default is missing, or the pair must be homed and is not.
        """
        name = f"move_absolute({shown(position)} {self.unit})"
        request = self._request(name)
        checked_position = request.checked_position(position)
        return self._move(
            name, request, TargetReference.ABSOLUTE, checked_position, (velocity, acceleration, jerk), buffer
        )

    def move_relative(
        self,
        distance: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        jerk: float | None = None,
        buffer: bool = False,
    ) -> Handle:
        """Move the beam by ``distance`` from its position at the start (MC_MoveRelative); raises as ``move_absolute``.

        No homing is needed. If the move would exceed a limit, its handle ends with the error.
        """
        name = f"move_relative({shown(distance)} {self.unit})"
        request = self._request(name)
        checked_distance = request.distance(distance)
        return self._move(
            name, request, TargetReference.RELATIVE, checked_distance, (velocity, acceleration, jerk), buffer
        )

    def move_additive(
        self,
        distance: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        jerk: float | None = None,
        buffer: bool = False,
    ) -> Handle:
        """Move the beam by ``distance`` from its last commanded position (MC_MoveAdditive); as ``move_relative``."""
        name = f"move_additive({shown(distance)} {self.unit})"
        request = self._request(name)
        checked_distance = request.distance(distance)
        return self._move(
            name, request, TargetReference.ADDITIVE, checked_distance, (velocity, acceleration, jerk), buffer
        )

    def move_velocity(self, velocity: float, *, acceleration: float | None = None) -> Handle:
        """Move the beam at ``velocity`` (signed, unit/s) until another command ends the motion (MC_MoveVelocity). Does not block.

        The handle is done when the velocity is reached. The beam comes to rest at the nearer position limit, if there is one. If
        the command is called again in the same direction, the beam changes to the new velocity with the acceleration of the first
        call.

        Raises:
            LimitError: beyond ``max_velocity`` or ``max_acceleration`` of either axis, or 0.
            ArgumentError: not finite, or a default is missing.
        """
        name = f"move_velocity({shown(velocity)} {self.unit}/s)"
        request = self._request(name)
        found = request.finite("velocity", velocity)
        speed, ramp = request.velocity(abs(found)), request.acceleration(acceleration)
        command = g.GantryVelocity(self._pair.axes, speed if found > 0.0 else -speed, ramp)
        return self._submit(name, command)

    def resume(self) -> Handle:
        """Continue the last interrupted move to its end (MC_GroupContinue); as ``Group.resume``.

        A velocity move begins again at its last velocity; its handle is done when that is reached.
        """
        return self._submit("resume()", GroupContinue(self._pair.axes))

    # -- homing --------------------------------------------------------------------------------------------------------

    def home(self) -> Handle:
        """Move both axes until each has reached its switch, count positions from there, and make the beam square (MC_Home).

        Configured by ``[gantries.NAME.homing]``, with the smaller of the axes' default accelerations. The beam ends at rest, beyond
        the switches. Does not block.

        Raises:
            ArgumentError: there is no such table, or a default acceleration is missing.
            StateError: a drive has no touch probe.
        """
        request = self._request("home()")
        request.homing()
        command = g.GantryHome(self._pair.axes, request.acceleration(None), next(_keys))
        return self._submit("home()", command)

    def set_position(self, position: float, *, square: bool = False) -> Handle:
        """Define the beam's present position as ``position`` (MC_SetPosition); both axes are then homed. Nothing moves.

        The known skew does not change. With ``square`` the present beam is defined as square: measure it first.

        Raises:
            ArgumentError: not finite. LimitError: out of the range of the drives.
        """
        name = f"set_position({shown(position)} {self.unit})"
        checked_position = self._request(name).named(position)
        return self._submit(
            name,
            g.GantrySetPosition(
                self._pair.axes, checked_position, flag_of(f"{self.name}.set_position", "square", square)
            ),
        )

    def square(
        self,
        axis: str | Axis | None = None,
        distance: float | None = None,
        *,
        velocity: float,
        acceleration: float | None = None,
    ) -> Handle:
        """Move one axis alone, slowly, while the other holds, to make a beam square again. Does not block.

        ``axis`` is the second one by default. It moves until the beam is square, or by ``distance`` units, with the set-points of
        both axes still coupled, monitored at the skew of ``enable(skew=...)``. When the beam is square, ``max_skew`` applies again.

        Raises:
            LimitError: beyond the limits of the axis.
            ArgumentError: not an axis of this pair, or a value is missing or not finite.
        """
        name = axis.name if isinstance(axis, Axis) else axis
        name = self._pair.second if name is None else name
        if not isinstance(name, str) or name not in self._pair.axes:
            raise ArgumentError(
                f"{self.name}.square: {short_repr(name)} is not an axis of this pair",
                remedy=f"it is {self._pair.first} or {self._pair.second}",
            )
        text = f"square({name})" if distance is None else f"square({name}, {shown(distance)} {self.unit})"
        request = self._request(text)
        checked_distance = None if distance is None else request.distance(distance)
        dynamics = request.velocity(velocity), request.acceleration(acceleration)
        return self._submit(text, g.GantrySquare(self._pair.axes, name, checked_distance, *dynamics))

    # ------------------------------------------------------------------------------------------------------------------

    def _move(
        self,
        name: str,
        request: BeamRequest,
        reference: TargetReference,
        value: float,
        dynamics: tuple[float | None, float | None, float | None],
        buffer: bool,
    ) -> Handle:
        velocity, acceleration, jerk = dynamics
        mode = buffering_of(f"{self.name}.{name}", buffer)
        if mode is not None and mode.blends:
            raise ArgumentError(
                f"{self.name}.{name}: the moves of a pair cannot be blended",
                remedy="let it begin at standstill: buffer=True",
            )
        speed, ramp, soft = request.velocity(velocity), request.acceleration(acceleration), request.jerk(jerk)
        command = g.GantryMove(self._pair.axes, reference, value, speed, ramp, soft, mode is not None)
        return self._submit(name, command)

    def _request(self, text: str) -> BeamRequest:
        facts = self._commanding.session.axes
        first, second = (facts[axis.name].parameters for axis in self)
        return BeamRequest(self._pair, (self._first, self._second), (first, second), text)


# -- Check the arguments of a gantry's call, in the axes' unit: the limits of both axes apply to the beam --------------


class BeamRequest:
    """One call, such as ``y.move_absolute(90 mm)``; raises ArgumentError for a missing value, LimitError beyond a limit."""

    def __init__(
        self,
        pair: GantryParameters,
        axes: tuple[Axis, Axis],
        parameters: tuple[AxisParameters, AxisParameters],
        text: str,
    ) -> None:
        """``text`` names the call in messages."""
        self.text = f"{pair.name}.{text}"
        self._pair, self._axes, self._parameters = pair, axes, parameters
        self._call = text
        self._unit = parameters[0].units.position.unit

    def finite(self, what: str, value: float) -> float:
        """Return ``value``, which must be a finite number."""
        return AxisCall(self._parameters[0], self._call).finite(what, value)

    def positive(self, what: str, value: float) -> float:
        """Return ``value``, which must be above 0."""
        return AxisCall(self._parameters[0], self._call).positive(what, value)

    def checked_position(self, position: float) -> float:
        """Return a position of the beam that both axes can reach."""
        checked_position = self.finite("position", position)
        for axis, at in zip(
            self._axes, (checked_position, checked_position + self._pair.offset), strict=True
        ):
            axis._absolute_increments(self._call, at)
        return checked_position

    def named(self, position: float) -> float:
        """Return the value for the beam's present position (``set_position``), which must be in the range of both drives."""
        checked_position = self.finite("position", position)
        for parameters, at in zip(
            self._parameters, (checked_position, checked_position + self._pair.offset), strict=True
        ):
            AxisCall(parameters, self._call).checked_position(at)
        return checked_position

    def distance(self, distance: float) -> float:
        """Return a distance that is in the range of both drives."""
        for parameters in self._parameters:
            AxisCall(parameters, self._call).distance(distance)
        return float(distance)

    def velocity(self, value: float | None) -> float:
        """Return a velocity (unit/s), by default the smaller of the axes', within the limits of both."""
        return self._within(
            "velocity", value, lambda found: found.velocity, lambda limits: limits.velocity, "/s"
        )

    def acceleration(self, value: float | None) -> float:
        """Return an acceleration (unit/s²), by default the smaller of the axes', within the limits of both."""
        return self._within(
            "acceleration", value, lambda found: found.acceleration, lambda limits: limits.acceleration, "/s²"
        )

    def jerk(self, value: float | None) -> float | None:
        """Return a jerk limit (unit/s³); None if neither the call nor an axis's default gives one."""
        if value is None:
            known = [one for each in self._parameters if (one := each.defaults.jerk) is not None]
            return min(known, default=None)
        return None if isinstance(value, float) and value == float("inf") else self.positive("jerk", value)

    def homing(self) -> None:
        """Raise ArgumentError if no homing is configured, StateError if a drive has no touch probe."""
        plan, name = self._pair.homing, self._pair.name
        if plan is None:
            raise ArgumentError(
                f"{self.text}: the cell file does not say how the pair is homed",
                remedy=f"add [gantries.{name}.homing] to cell.toml; or give the position of the beam: {name}.set_position(...)",
            )
        for parameters in self._parameters[: 2 if plan.each else 1]:
            require_objects(
                AxisCall(parameters, self._call), parameters, plan.input, frozenset[Edge]({plan.edge})
            )

    def _within(
        self,
        what: str,
        value: float | None,
        default: Callable[[Defaults], float | None],
        limit: Callable[[AxisLimits], float | None],
        per: str,
    ) -> float:
        if value is None:
            value = self._default(what, default)
        found = self.positive(what, value)
        for parameters in self._parameters:
            most = limit(parameters.limits)
            if most is not None and found > most:
                raise LimitError(
                    f"{self.text}: {what} {found:g} {self._unit}{per} is beyond that of {parameters.name}",
                    observed=f"its max_{what} is {most:g} {self._unit}{per}",
                    remedy=f"give a smaller value, or change max_{what} in [axes.{parameters.name}] of cell.toml",
                )
        return found

    def _default(self, what: str, default: Callable[[Defaults], float | None]) -> float:
        found = []
        for parameters in self._parameters:
            known = default(parameters.defaults)
            if known is None:
                raise ArgumentError(
                    f"{self.text}: {what} is missing",
                    observed=f"the call does not give it, and {parameters.name} has no default",
                    remedy=f"give {what} = ... in the call, or {what} in [axes.{parameters.name}.defaults]",
                )
            found.append(known)
        return min(found)
