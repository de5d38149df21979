"""Moves of one axis that pass into each other with a limited jerk: the axis is at the mean of the last cycles of their course.

Theory of operation
-------------------
What goes along the course (``SmoothedProfile``) is as hard as the legs are, under every override, and the axis is led to the mean
of its last places. So its velocity and its acceleration are means, too, and the acceleration changes by no more than twice that of
the legs in the time of the mean. The course leaves room at its joints for that, so that they are passed as fast as they are to be.

How many cycles the mean takes is settled by the first of the moves; another one may join that needs no more. Time never runs faster
than it does without an override: the course would be harder by its square.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from axisbus.motion.axis.image import AxisImage
from axisbus.motion.blending.blended_profile import BlendedProfile, course_along
from axisbus.motion.blending.csp_blending import BlendedCommand, BlendedMoves
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.jerk.jerk_limited_move import JerkLimitedMove
from axisbus.motion.jerk.online_profile import JerkLimits, OnlineProfile, ReferenceState
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.pathclock import PathClock

# Time comes to another rate by what a straight line says of the speeds (``PathClock``); on a course that bends, an eighth is lost.
_STRAIGHT = 0.85


class SmoothedProfile:
    """Goes along a course, and holds its last times and places. To the axis it is its clock: ``t`` is the time of the mean."""

    __slots__ = ("_places", "_times", "braking", "course", "led", "ramp", "t", "time")

    def __init__(
        self, course: BlendedProfile, places: deque[float], led: ReferenceState, ramp: float, period: float
    ) -> None:
        """``places``: those of the last cycles, as many as the mean has, the last of them where ``course`` begins.

        ``led``: where the axis is led to by now; ``ramp``: by how much the speed ahead may change, in unit/s².
        """
        window = len(places)
        self.course = course
        self.led = led
        self.ramp = ramp
        self.time = PathClock()
        self.braking = False
        self._places = places
        self._times = deque((-number * period for number in range(window - 1, -1, -1)), maxlen=window)
        self.t = sum(self._times) / window

    @property
    def window(self) -> int:
        """Of how many cycles the mean is taken."""
        return len(self._places)

    @property
    def stopped(self) -> bool:
        """Whether it stands because it was braked."""
        return self.braking and self.time.stopped and self._rests

    def told(self, t: float) -> str:
        """Return a time for people."""
        return self.time.told(t)

    def aim(self, factor: float) -> None:
        """Let time come to run at ``factor``, 1 at most."""
        self.time.aim(min(factor, 1.0), self._way, self.ramp)

    def brake(self) -> None:
        """Come to rest on the course; a second call changes nothing."""
        self.braking = True
        self.time.brake(self._way, self.ramp)

    def advance(self, period: float) -> None:
        """Go on by one cycle of ``period`` seconds."""
        self.time.advance(period)
        t, times, before = min(self.time.t, self.course.duration), self._times, self.led
        times.append(t)
        self._places.append(self.course.position(t))
        self.t = t if times[0] == t else sum(times) / len(times)
        place = self._places[-1] if self._rests else sum(self._places) / len(self._places)
        velocity = (place - before.place) / period
        self.led = ReferenceState(place, velocity, (velocity - before.velocity) / period)

    def walk(self, target: float, gait: JerkLimits, by: float) -> OnlineProfile:
        """Return what goes on from here to ``target``, with all places ``by`` farther on."""
        places = deque((place + by for place in self._places), maxlen=self.window)
        speed = self.course.speed(self.time.t) * self.time.rate
        return OnlineProfile(target, gait, places, speed, self.led._replace(place=self.led.place + by))

    @property
    def _rests(self) -> bool:
        """Whether nothing ahead has moved for all of the mean."""
        return self._times[0] == self._times[-1]

    def _way(self, t: float) -> float:
        return self.course.position(t)


@dataclass(frozen=True, slots=True)
class _Softened:
    """The course as the axis is led along it, as a trajectory: it is asked for the present place alone."""

    ahead: SmoothedProfile
    span: tuple[float, float]
    top_speed: float
    top_acceleration: float
    duration: float

    def position(self, _t: float) -> float:
        """Return the place of this cycle."""
        return self.ahead.led.place


class JerkLimitedBlendedMoves(BlendedMoves):
    """Holds what goes along the course of the commands, once that is known."""

    def __init__(
        self, part: BlendedCommand, parameters: AxisParameters, gate: StartBarrier, window: int
    ) -> None:
        """``part``: the first command, which begins from rest (or see ``taken_up``); ``window``: of how many cycles the mean is."""
        super().__init__(part, parameters, gate)
        self._window = window
        self.ahead: SmoothedProfile | None = None

    @property
    def window(self) -> int:
        """Of how many cycles the mean is taken."""
        return self._window

    @property
    def acceleration(self) -> float:
        """With which acceleration it leads the axis (unit/s²)."""
        ahead = self.ahead
        is_led = ahead is not None and self.clock is ahead and self._addition is None
        return ahead.led.acceleration if ahead is not None and is_led else super().acceleration

    def walk_to(self, target: float, gait: JerkLimits) -> OnlineProfile | None:
        """Return what goes on from here to ``target``, where it leads the axis; None where it does not."""
        ahead = self.ahead
        if ahead is None or self.clock is not ahead or self._addition is not None:
            return None
        return ahead.walk(target, gait, self.shifted)

    def take_up_softly(self, way: ProfileFromSpeed, before: JerkLimitedMove) -> None:
        """Be the first command, which goes on already: ``way`` is what ``before`` has in front."""
        walk = before.walk
        assert walk is not None
        course = course_along(way, self._mean)
        self._guide(course, walk.places, walk.led)
        self._lead_along(course)
        self.resume(before)
        self.shifted, self._deadline = before.shifted, before.deadline

    def _go_ahead(self, image: AxisImage) -> None:
        ahead = self.ahead
        if ahead is not None and self._running and self.clock is ahead:
            if not ahead.braking:
                ahead.aim(image.override)
            ahead.advance(self._period)

    def begin_braking(self) -> bool:
        """Begin to brake by the axis's own deceleration, as hard as without a jerk; along the course where none is known."""
        return self.brake_alone() or super().begin_braking()

    @property
    def _mean(self) -> float:
        # One cycle more than there is between its places: joints lie between cycles.
        return self._window * self._period

    @property
    def _along(self) -> float:
        return 0.0 if self.ahead is None else self.ahead.time.t

    def _be_led(self, course: BlendedProfile) -> None:
        ahead = self.ahead
        if ahead is not None:
            ahead.course, ahead.ramp = course, self._least_ramp
            self.lead_on(self._softened(ahead))
            return
        here = course.position(0.0)
        self._guide(course, deque([here] * self._window, maxlen=self._window), ReferenceState(here))

    def _guide(self, course: BlendedProfile, places: deque[float], led: ReferenceState) -> None:
        self.ahead = ahead = SmoothedProfile(course, places, led, self._least_ramp, self._period)
        self.guide_by(ahead, self._softened(ahead))

    def _softened(self, ahead: SmoothedProfile) -> _Softened:
        course = ahead.course
        low, high = course.span
        span = min(low, ahead.led.place), max(high, ahead.led.place)
        return _Softened(ahead, span, course.top_speed, course.top_acceleration, course.duration)

    @property
    def _least_ramp(self) -> float:
        return _STRAIGHT * min(min(leg.up, leg.down) for leg in self._legs())

    def _pass_ends(self, course: BlendedProfile) -> None:
        if self.clock is self.ahead:  # else it is braked, and goes by no course
            super()._pass_ends(course)
