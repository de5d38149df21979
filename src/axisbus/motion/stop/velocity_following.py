"""Compare the distance that a ramped velocity command should cover with the distance covered; the difference decays with time.

Theory of operation
-------------------
The commanded velocity rises with the profile acceleration and falls with the deceleration, beginning at the axis's velocity at the
start. Its distance is integrated from position to position, and the covered distance is subtracted. The exact integral of a speed
that is one increment off would grow forever, so the difference decays. The slower the commanded velocity is, the longer the decay
takes. An axis that covers less than half of its distance is detected within about 1.4 times ``window / speed + 0.25 s``. An axis
that covers more is not detected.

The cycle in which the drive takes a new velocity is not known: the frame waits for SYNC, and the drive for its next task. So from
the moment a velocity is sent until the latest moment at which it is taken (``_TAKEN`` periods later, plus the time of the transfer
if the velocity is written by SDO) the drive can be on the ramp to it, or to any velocity that was sent before and is not surely
replaced. Two ramps bound what the axis may do: one always goes to the lowest of these velocities, the other to the highest. An
axis between both has no following error. (A drive that takes a fast velocity at once and the slow one after it late covers more
than with any one delay for both; if it slows down weakly, much more.) A third ramp takes each velocity at once; it gives the lag.

After an override of 0, or a velocity of 0, the axis settles later than the ramps, by its lag. ``_SETTLED`` seconds after both ramps
have come to rest, the axis is assumed to be at its commanded position. Any later motion counts. If another velocity is given
before that, the distance that the axis has settled so far does not count for it.

The following distance of a motor with a constant lag is the lag multiplied by the velocity that the motor itself has gained.
Until the ramp ends, the motor has gained less velocity than the ramp, by the lag multiplied by the acceleration: in the first
five lags, by more than a fifth. The difference and the gain decay alike, so their ratio is the lag (a little more if the lag is
long). The ramp without a delay is used, so the ratio includes the time in which the drive accepts a command. The look-ahead of the
limits already allows ``_TAKEN`` periods for that; only a longer time is the ``lag``. The lag is measured while the velocity
changes and shortly after. Later the gain has decayed, and a small velocity error would look like a lag. If the velocity has
risen and fallen, both gains cancel, and what is left of them gives no lag. A motion that begins at speed gives no lag: its
demand at that moment is unknown, and a demand that is ahead looks like an axis without a lag. If a new velocity is given while
the drive is still on the ramp of the previous command, the demand is known. In this case the computation continues with that
ramp (``continue_with``). The accelerations of the new command are written before its velocity, and most drives use them at once for
the velocity that they still have. So from the first write on (``expect``) each bound has the acceleration that moves it outwards.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from axisbus.cia402 import objects
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.parameters import NOISE, AxisParameters

_LAG_TIME = 0.25  # seconds of lag that a drive may have (see ``AxisParameters.lag_allowed``)
_LONGEST = 60.0  # seconds of memory
# seconds; less than the time for which a commanded speed excuses a lag (``following._SPEED_TIME``)
_SETTLED = 0.4
_ONE_DIRECTION = 0.75  # share of the changes of velocity by which one direction must prevail
_TAKEN = 4.0  # scan periods: until the next SYNC, until the drive acts, and until this is seen


class _Ramp:
    """One ramp: its velocity, and the axis's distance behind it.

    ``side``: 1 and -1 for the upper and the lower bound, which move outwards as fast and inwards as slowly as possible; 0 for the
    ramp of a drive that takes each velocity, and the higher of two accelerations, at once. ``gained``: the change of its velocity,
    which decays as ``behind`` does; ``total_change``: the same without the signs of the changes. ``rate``: its last acceleration.
    """

    __slots__ = ("behind", "gained", "rate", "side", "speed", "total_change")

    def __init__(self, speed: float, side: int) -> None:
        self.speed = speed
        self.side = side
        self.behind = self.gained = self.total_change = self.rate = 0.0

    def ramp(self, target: float, rates: _Rates, dt: float, covered: float, remaining: float) -> None:
        """Advance by ``dt`` s, in which the axis moved by ``covered``; ``remaining``: the share that remains after the decay."""
        before = self.speed
        slows = abs(target) < abs(before) or before * target < 0.0
        least, most = rates.down if slows else rates.up
        outwards = self.side == 0 or (target > before) == (self.side > 0)
        change = (most if outwards else least) * dt
        self.speed = max(before - change, target) if target < before else min(before + change, target)
        self.behind = self.behind * remaining + 0.5 * (before + self.speed) * dt - covered
        self.gained = self.gained * remaining + self.speed - before
        self.total_change = self.total_change * remaining + abs(self.speed - before)
        self.rate = (self.speed - before) / dt


@dataclass(frozen=True, slots=True)
class _Rates:
    """The lowest and the highest acceleration and deceleration that a drive may use, in position increments per s²."""

    up: tuple[float, float]
    down: tuple[float, float]

    @classmethod
    def of(cls, up: float, down: float) -> _Rates:
        return cls((up, up), (down, down))

    def widened(self, up: float, down: float) -> _Rates:
        """Return the rates of a drive that may use these accelerations already."""
        return _Rates(
            (min(self.up[0], up), max(self.up[1], up)), (min(self.down[0], down), max(self.down[1], down))
        )


class VelocityRampTracker:
    """Holds the present commanded velocity, and the axis's distance behind it (position increments, None: not known).

    ``lag``: the lag of the axis behind its commands in seconds, beyond ``delay``; None: not known.
    """

    __slots__ = (
        "_changed",
        "_delay",
        "_due",
        "_from_rest",
        "_high",
        "_last_velocity",
        "_low",
        "_on_ramp",
        "_per_velocity",
        "_position",
        "_prompt",
        "_rates",
        "_settles_at",
        "_stamp",
        "_taken",
        "_target",
        "_window",
        "behind",
        "lag",
    )

    def __init__(
        self,
        target: float,
        per_velocity: float,
        up: float,
        down: float,
        window: float,
        delay: float = 0.0,
        *,
        on_ramp: bool = False,
    ) -> None:
        """``target`` in the drive's velocity increments (signed), each of ``per_velocity`` position increments per s.

        ``up`` and ``down`` in position increments per s², above 0; ``window`` in position increments; ``delay``: seconds within
        which the drive takes a target that is sent by PDO. ``on_ramp``: the drive is on the ramp of another velocity, so an axis
        that looks at rest is only turning back.
        """
        self._target = target * per_velocity
        self._per_velocity = per_velocity
        self._window = window
        self._delay = delay
        self._position = 0
        self._stamp = 0.0
        self._changed = -math.inf
        self._settles_at = math.inf
        self._from_rest = False
        self._last_velocity = 0.0  # the last velocity other than 0
        self._on_ramp = on_ramp
        self._rates = _Rates.of(up, down)
        self._taken = 0.0  # the last velocity that is surely taken
        self._due: deque[tuple[float, float]] = deque()  # until when each velocity sent since is surely taken
        self._begin(0.0)
        self.behind: float | None = None
        self.lag: float | None = None

    @property
    def speed(self) -> float:
        """The present commanded velocity in position increments per s; the higher of two while the drive may take a new one."""
        return max(self._low.speed, self._high.speed, key=abs)

    def aim(self, target: float) -> None:
        """Change to another target, in the drive's velocity increments."""
        self._target = target * self._per_velocity

    @property
    def began_at_rest(self) -> bool:
        """Whether the drive's commanded velocity is known: the motion began at standstill, and its position is known."""
        return self._from_rest and self.behind is not None

    def expect(self, up: float, down: float) -> None:
        """Allow for a drive that already uses the accelerations of the next command; units as in the constructor."""
        self._rates = self._rates.widened(up, down)

    def continue_with(self, target: float, up: float, down: float) -> None:
        """Continue with another command, from the commanded velocity that the drive has by now; units as in the constructor."""
        self._rates = _Rates.of(up, down)
        self.aim(target)

    def step(self, image: AxisImage) -> None:
        """Evaluate this cycle's position; begin with the axis's motion once it is known."""
        position, stamp = image.position, image.position_stamp
        if position is None:
            self.behind = None
            return
        if self.behind is None:
            speed = image.speed(self._per_velocity)
            if speed is None:
                return
            self._taken = speed
            self._due.clear()
            self._begin(speed)
            self._from_rest = image.standstill and not self._on_ramp
            self.behind, self._position, self._stamp = 0.0, position, stamp
            self._send(image)
            return
        if self._sent != self._target:
            if not self._low.speed and not self._high.speed and self.behind * self._last_velocity < 0.0:
                self._settled()
            self._send(image)
        if stamp > self._stamp:
            self._advance(position, stamp - self._stamp)
            self._position, self._stamp = position, stamp

    @property
    def _sent(self) -> float:
        """The last velocity that was sent."""
        return self._due[-1][1] if self._due else self._taken

    def _begin(self, speed: float) -> None:
        self._prompt, self._low, self._high = _Ramp(speed, 0), _Ramp(speed, -1), _Ramp(speed, 1)

    def _send(self, image: AxisImage) -> None:
        self._due.append((image.now + self._delay + image.velocity_transfer, self._target))

    def _advance(self, position: int, dt: float) -> None:
        while self._due and self._due[0][0] <= self._stamp:
            self._taken = self._due.popleft()[1]
        possible = [self._taken, *(target for _, target in self._due)]
        covered, remaining = position - self._position, 1.0 - min(1.0, dt / self._memory())
        before = self._prompt.speed
        for ramp, target in (
            (self._prompt, possible[-1]),
            (self._low, min(possible)),
            (self._high, max(possible)),
        ):
            ramp.ramp(target, self._rates, dt, covered, remaining)
        if self._prompt.speed != before:
            self._changed = self._stamp
        self._last_velocity = self._prompt.speed or self._last_velocity
        self._settle(self._stamp + dt)
        if self._from_rest and self._stamp - self._changed <= _LAG_TIME:
            self._take_lag(self._prompt)
        self.behind = self._low.behind if self._low.behind > 0.0 else min(self._high.behind, 0.0)

    def _settle(self, now: float) -> None:
        if self._low.speed or self._high.speed:
            self._settles_at = now + _SETTLED
        elif now >= self._settles_at:
            self._settled()

    def _settled(self) -> None:
        """Assume that the axis is at its commanded position."""
        self._settles_at = math.inf
        for ramp in (self._prompt, self._low, self._high):
            ramp.behind = ramp.gained = ramp.total_change = 0.0

    def _take_lag(self, ramp: _Ramp) -> None:
        if abs(ramp.gained) * _LAG_TIME <= NOISE:
            return  # too slow: an allowed lag would be within the noise
        if abs(ramp.gained) < _ONE_DIRECTION * ramp.total_change:
            return
        distance = max(0.0, math.copysign(ramp.behind, ramp.behind * ramp.gained) - NOISE)
        lag = distance / abs(ramp.gained)
        if ramp.rate * ramp.gained > 0.0:
            lag = distance / max(0.5 * abs(ramp.gained), abs(ramp.gained) - abs(ramp.rate) * lag)
        self.lag = min(max(0.0, lag - self._delay), _LAG_TIME)

    def _memory(self) -> float:
        """Return the decay time in seconds: twice the time in which an axis at standstill uses up the allowed difference."""
        fastest = max(abs(self.speed), abs(self._target))
        return min(_LONGEST, 2.0 * (self._window / fastest + _LAG_TIME)) if fastest else _LONGEST


def drive_ramp_tracker(
    profile: MoveProfile, parameters: AxisParameters, before: VelocityRampTracker | None = None
) -> VelocityRampTracker | None:
    """Return the monitor of a velocity move; None if the drive's ramps, or the ratio of its units, are not known.

    ``before``: the monitor of the previous velocity, if the drive is on its ramp; it continues if it began at rest.
    """
    units = parameters.units
    if not profile.up or not profile.down or not parameters.has(objects.PROFILE_ACCELERATION):
        return None
    if before is not None and before.began_at_rest:
        before.continue_with(profile.velocity, profile.up, profile.down)
        return before
    return VelocityRampTracker(
        profile.velocity,
        units.per_velocity,
        profile.up,
        profile.down,
        parameters.pull_window,
        _TAKEN * parameters.scan_period,
        on_ramp=before is not None and before.speed != 0.0,
    )


def master_ramp_tracker(parameters: AxisParameters) -> VelocityRampTracker | None:
    """Return the monitor of velocities generated by the master, each given with ``aim``; None if the unit ratio is not known."""
    units = parameters.units
    if not units.ratio_known:
        return None
    at_once = math.inf
    return VelocityRampTracker(
        0.0, units.per_velocity, at_once, at_once, parameters.pull_window, _TAKEN * parameters.scan_period
    )
