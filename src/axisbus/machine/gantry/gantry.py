"""A pair of axes that carry one beam, as its user sees it: one thing to enable, home, move and stop."""

from __future__ import annotations

import itertools

from axisbus.errors import ArgumentError, LimitError, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.axis_set.axis_set import AxisSet
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.gantry.request import BeamRequest
from axisbus.machine.handle import Handle
from axisbus.machine.request import buffering_of, flag_of, shown
from axisbus.motion.commands import TargetReference
from axisbus.motion.gantry import commands as g
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.group.commands import GroupContinue
from axisbus.motion.numbers import told

_keys = itertools.count(1)


class Gantry(AxisSet):
    """Two axes that carry one beam; the place of the beam is that of the first. Each command returns one ``Handle`` for both.

    Both are led by one set-point in csp, within the smaller of their limits, and how far the beam is out of square is watched in
    every cycle: beyond ``max_skew`` both are stopped, on their way. They cannot be moved one by one, but by ``square``. ``reset``
    is refused while a beam that is driven is out of square: disable it first. In ``quick_stop`` each drive goes down its own ramp
    (605Ah, 6085h): make these the same.
    """

    def __init__(
        self, parameters: GantryParameters, first: Axis, second: Axis, commanding: CommandDispatcher
    ) -> None:
        super().__init__(parameters.name, {axis.name: axis for axis in (first, second)}, commanding)
        self._pair = parameters
        self._first, self._second = first, second

    # -- where it is ---------------------------------------------------------------------------------------------------

    @property
    def unit(self) -> str:
        """The unit of its positions, that of both axes."""
        return self._first.unit

    @property
    def position(self) -> float:
        """Where the beam is: the actual position of its first axis, in its unit; raises StaleError when it is unknown."""
        return self._first.position

    @property
    def max_skew(self) -> float:
        """How far out of square the beam may be, in units."""
        return self._pair.max_skew

    @property
    def skew(self) -> float:
        """How far out of square the beam is, in units: how much farther the second axis is than the first, less the offset.

        Raises:
            StateError: the axes are not homed, so that nobody knows.
            StaleError: a position is unknown.
        """
        if not self.homed:
            raise StateError(
                f"{self.name}: nobody knows how far the beam is out of square",
                observed="its axes are not homed",
                remedy=f"home the pair first: {self.name}.home(), or set_position(...)",
            )
        return self._second.position - self._first.position - self._pair.offset

    @property
    def homed(self) -> bool:
        """Whether the places of both axes are confirmed: homed, set, or of absolute encoders (``required = false``)."""
        facts = self._commanding.session.axes
        return all(axis.homed or not facts[axis.name].parameters.homing.required for axis in self)

    # -- power and stopping --------------------------------------------------------------------------------------------

    def enable(self, *, skew: float | None = None) -> Handle:
        """Switch both power stages on in one SYNC (MC_Power); neither jumps, also where they hold against each other.

        Refused where the beam is out of square by more than ``max_skew``: the handle ends with a SkewError that has the figures.
        ``skew`` (units, above ``max_skew``) lets it be enabled all the same, watched at that bound, to be made square: until
        ``square`` has done so, nothing else moves it. Does not block.

        Raises:
            ArgumentError: ``skew`` is no number above ``max_skew``.
        """
        if skew is None:
            return self._submit("enable()", g.GantryEnable(self._pair.axes))
        request = self._request("enable")
        wide = request.distance(request.positive("skew", skew))
        if wide <= self.max_skew:
            raise LimitError(
                f"{self.name}.enable: skew {wide:g} {self.unit} is not above max_skew = {self.max_skew:g} {self.unit}",
                remedy="leave it out: max_skew holds without it",
            )
        return self._submit(f"enable(skew={wide:g} {self.unit})", g.GantryEnable(self._pair.axes, wide))

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
        """Move the beam to ``position`` (MC_MoveAbsolute), from rest, and square: the second axis goes to that plus the offset.

        What is left out is the smaller of the axes' defaults; ``jerk`` as ``Group.move_linear``. Does not block. With ``buffer`` it
        begins when what the pair does has ended well.

        Raises:
            LimitError: beyond the limits of either axis.
            ArgumentError: not finite, not positive, a default is missing, or the pair is not homed where it must be.
        """
        name = f"move_absolute({shown(position)} {self.unit})"
        request = self._request(name)
        place = request.place(position)
        return self._move(
            name, request, TargetReference.ABSOLUTE, place, (velocity, acceleration, jerk), buffer
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
        """Move the beam by ``distance`` from where it is when it starts (MC_MoveRelative); raises as ``move_absolute``.

        It needs no homing. A limit that it would break ends its handle.
        """
        name = f"move_relative({shown(distance)} {self.unit})"
        request = self._request(name)
        way = request.distance(distance)
        return self._move(
            name, request, TargetReference.RELATIVE, way, (velocity, acceleration, jerk), buffer
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
        """Move the beam by ``distance`` from where it was told to go last (MC_MoveAdditive); as ``move_relative``."""
        name = f"move_additive({shown(distance)} {self.unit})"
        request = self._request(name)
        way = request.distance(distance)
        return self._move(
            name, request, TargetReference.ADDITIVE, way, (velocity, acceleration, jerk), buffer
        )

    def move_velocity(self, velocity: float, *, acceleration: float | None = None) -> Handle:
        """Move the beam at ``velocity`` (signed, unit/s) until something else is wanted (MC_MoveVelocity). Does not block.

        The handle is done when the velocity is reached. It comes to rest at the nearer position limit, if there is one. Asked for
        again in the same direction, it goes on with the other velocity, by the acceleration that it began with.

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
        """Go on with the last move, from where it was left, to its end (MC_GroupContinue); as ``Group.resume``."""
        return self._submit("resume()", GroupContinue(self._pair.axes))

    # -- where it is said to be ----------------------------------------------------------------------------------------

    def home(self) -> Handle:
        """Lead both together until each has seen its switch, count from there, and make the beam square (MC_Home).

        By ``[gantries.NAME.homing]``; with the smaller of the axes' default accelerations. Ends at rest, beyond the switches. Does
        not block.

        Raises:
            ArgumentError: there is no such table, or a default acceleration is missing.
            StateError: a drive has no touch probe.
        """
        request = self._request("home()")
        request.homing()
        command = g.GantryHome(self._pair.axes, request.acceleration(None), next(_keys))
        return self._submit("home()", command)

    def set_position(self, position: float, *, square: bool = False) -> Handle:
        """Call where the beam is ``position`` from now on (MC_SetPosition); both axes are homed by it. Nothing moves.

        How far it is out of square stays as it is known; with ``square`` it is taken to be square as it stands: measure it first.

        Raises:
            ArgumentError: not finite. LimitError: more than the drives can count.
        """
        name = f"set_position({shown(position)} {self.unit})"
        place = self._request(name).named(position)
        return self._submit(
            name,
            g.GantrySetPosition(
                self._pair.axes, place, flag_of(f"{self.name}.set_position", "square", square)
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
        """Move one axis alone, while the other holds: the way out of a beam that is out of square. Slowly; does not block.

        ``axis`` is the second one by default. It goes until the beam is square, or by ``distance`` units, on the line that both are
        led by, watched at the bound of ``enable(skew=...)``. When the beam is square, ``max_skew`` holds again.

        Raises:
            LimitError: beyond the limits of the axis.
            ArgumentError: no axis of this pair, or a value is missing or not finite.
        """
        name = axis.name if isinstance(axis, Axis) else axis
        name = self._pair.second if name is None else name
        if not isinstance(name, str) or name not in self._pair.axes:
            raise ArgumentError(
                f"{self.name}.square: {told(name)} is no axis of this pair",
                remedy=f"it is {self._pair.first} or {self._pair.second}",
            )
        text = f"square({name})" if distance is None else f"square({name}, {shown(distance)} {self.unit})"
        request = self._request(text)
        way = None if distance is None else request.distance(distance)
        pace = request.velocity(velocity), request.acceleration(acceleration)
        return self._submit(text, g.GantrySquare(self._pair.axes, name, way, *pace))

    # ------------------------------------------------------------------------------------------------------------------

    def _move(
        self,
        name: str,
        request: BeamRequest,
        reference: TargetReference,
        value: float,
        pace: tuple[float | None, float | None, float | None],
        buffer: bool,
    ) -> Handle:
        velocity, acceleration, jerk = pace
        mode = buffering_of(f"{self.name}.{name}", buffer)
        if mode is not None and mode.blends:
            raise ArgumentError(
                f"{self.name}.{name}: a pair does not blend", remedy="let it begin from rest: buffer=True"
            )
        speed, ramp, soft = request.velocity(velocity), request.acceleration(acceleration), request.jerk(jerk)
        command = g.GantryMove(self._pair.axes, reference, value, speed, ramp, soft, mode is not None)
        return self._submit(name, command)

    def _request(self, text: str) -> BeamRequest:
        facts = self._commanding.session.axes
        first, second = (facts[axis.name].parameters for axis in self)
        return BeamRequest(self._pair, (self._first, self._second), (first, second), text)
