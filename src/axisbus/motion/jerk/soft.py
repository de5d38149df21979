"""A move with a limited jerk that the master leads: for drives that have no profile jerk of their own, and for virtual axes.

Theory of operation
-------------------
It is a line of one axis: its travel, with the mean of the last cycles (``group.travel``), is that of a group's line. So an override
changes its speed within the same jerk. A halt does not wait for that: it brakes with the axis's own deceleration, as hard as it
would without.
"""

from __future__ import annotations

from axisbus.errors import MotionTimeout
from axisbus.motion.axis.image import Image
from axisbus.motion.axis.order import Order
from axisbus.motion.group.along import Along, Share
from axisbus.motion.group.gate import Gate
from axisbus.motion.group.path import plan_line, window_of
from axisbus.motion.group.travel import Travel
from axisbus.motion.moves.activity import where_text
from axisbus.motion.moves.follow import Follow
from axisbus.motion.moves.profile import Profile
from axisbus.motion.override.factor import FASTER, spared
from axisbus.motion.parameters import AxisParameters


class SoftMove(Follow):
    """One axis on its way from rest to a position in csp; holds its goal and its deadline."""

    foresees = False

    def __init__(
        self, target: int, profile: Profile, parameters: AxisParameters, gate: Gate, name: str
    ) -> None:
        """``target`` in unwrapped increments; ``profile`` with all of its ratios, and a jerk; ``name`` says what was asked for."""
        super().__init__(None, parameters, gate, Travel())
        self._goal = target
        self._profile = profile
        self._name = name
        self._deadline: float | None = None

    def step(self, image: Image, order: Order) -> bool:
        """Return True when the axis has come up with its target."""
        travel = self._travel
        if travel is not None:
            travel.factor = image.override
            if self._running:
                travel.advance(self._period)
            elif self._prepared and self._trajectory is None:
                self._plan(travel, image)
        if super().step(image, order):
            return True
        self._check_deadline(image)
        return False

    def begin_braking(self) -> bool:
        """Begin to brake by the axis's own deceleration, as hard as without a limit of jerk; along the way where none is known."""
        return self.brake_alone() or super().begin_braking()

    def _plan(self, travel: Travel, image: Image) -> None:
        units, profile, name = self._parameters.units.position, self._profile, self._parameters.name
        start, end = (units.to_units(place - image.origin) for place in (self.reference(image), self._goal))
        assert profile.speed
        assert profile.ramp
        unit = abs(units.factor)
        asked = profile.speed / unit, profile.ramp / unit
        way, velocity = plan_line({name: start}, {name: end}, {name: self._parameters}, *asked, self._name)
        window = window_of(way, abs(end - start), profile.softness, self._period, self._name)
        along = Along(way, 0.0, (start,))
        self.begin(Share(along, 0, FASTER * velocity))
        travel.begin(way, velocity, 0.0, window)

    def _check_deadline(self, image: Image) -> None:
        timeout = self._profile.timeout
        if timeout is None:
            return
        self._deadline = image.now + timeout if self._deadline is None else self._deadline
        self._deadline += spared(image.override, self._period)
        if image.now > self._deadline:
            name, units = self._parameters.name, self._units
            raise MotionTimeout(
                f"{name}: has not arrived at {units.to_units(self._goal - image.origin):g} {units.unit}",
                axis=name,
                observed=f"position {where_text(image, self._parameters)}; the timeout of {timeout:g} s has passed",
                remedy="give more time, or look whether the axis is blocked",
            )
