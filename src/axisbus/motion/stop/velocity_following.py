"""Compare the distance that a ramped velocity command should cover with the distance covered; the difference decays with time.

Theory of operation
-------------------
The commanded velocity rises with the profile acceleration and falls with the deceleration, beginning at the axis's velocity at the
start. Its distance is integrated from position to position, and the covered distance is subtracted. The exact integral of a speed
that is one increment off would grow forever, so the difference decays. The slower the commanded velocity is, the longer the decay
takes. An axis that covers less than half of its distance is detected within about 1.4 times ``window / speed + 0.25 s``. An axis
that covers more is not detected.

The cycle in which the drive takes a new velocity is not known: the frame waits for SYNC, and the drive for its next task. So two
ramps are integrated: one takes the new velocity at once, the other at the latest moment (``_TAKEN`` periods later, plus the time of
the transfer if the velocity is written by SDO). An axis between both ramps has no following error.

After an override of 0, or a velocity of 0, the axis settles later than the ramps, by its lag. ``_SETTLED`` seconds after both ramps
have come to rest, the axis is assumed to be at its commanded position. Any later motion counts.

The following distance of a motor with a constant lag is the lag multiplied by the velocity that the motor itself has gained.
Until the ramp ends, the motor has gained less velocity than the ramp, by the lag multiplied by the acceleration: in the first
five lags, by more than a fifth. The difference and the gain decay alike, so their ratio is the lag (a little more if the lag is
long). The earlier ramp is used, so the ratio includes the time in which the drive accepts a command. The look-ahead of the
limits already allows ``_TAKEN`` periods for that; only a longer time is the ``lag``. The lag is measured while the velocity
changes and shortly after. Later the gain has decayed, and a small velocity error would look like a lag. If the velocity has
risen and fallen, both gains cancel, and what is left of them gives no lag. A motion that begins at speed gives no lag: its
demand at that moment is unknown, and a demand that is ahead looks like an axis without a lag. If a new velocity is given while
the drive is still on the ramp of the previous command, the demand is known. In this case the computation continues with that
ramp (``go_on``). The accelerations of the new command are written before its velocity, and most drives use them at once for the
velocity that they still have. So from the first write on (``expect``) the earlier ramp has the higher of both accelerations,
and the later ramp has the lower one.
"""

from __future__ import annotations

import math
from collections import deque

from axisbus.cia402 import objects
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.parameters import NOISE, AxisParameters

_LAG_TIME = 0.25  # seconds of lag that a drive may have (see ``AxisParameters.lag_allowed``)
_LONGEST = 60.0  # seconds of memory
_SETTLED = (
    0.4  # seconds; less than the time for which a commanded speed excuses a lag (``following._SPEED_TIME``)
)
_ONE_WAY = 0.75  # share of the changes of velocity by which one direction must prevail
_TAKEN = 4.0  # scan periods: until the next SYNC, until the drive acts, and until this is seen


class _Ramp:
    """One ramp: its velocity, its target, the axis's distance behind it, and the targets that become valid later (time, target).

    ``gained``: the change of its velocity, which decays as ``behind`` does; ``stirred``: the same without the signs of the changes.
    ``rate``: its last acceleration (per s²).
    """

    __slots__ = ("_due", "behind", "down", "gained", "rate", "speed", "stirred", "target", "up")

    def __init__(self, speed: float, target: float, up: float, down: float) -> None:
        self.speed = speed
        self.target = target
        self.up = up
        self.down = down
        self.behind = self.gained = self.stirred = self.rate = 0.0
        self._due: deque[tuple[float, float]] = deque()

    def aim(self, target: float, when: float) -> None:
        self._due.append((when, target))

    def take_up(self, until: float) -> None:
        while self._due and self._due[0][0] <= until:
            self.target = self._due.popleft()[1]

    def ramp(self, dt: float, made: float, kept: float) -> None:
        """Advance by ``dt`` s, in which the axis has moved by ``made``; ``kept``: the share that remains after the decay."""
        before, target = self.speed, self.target
        slows = abs(target) < abs(before) or before * target < 0.0
        change = (self.down if slows else self.up) * dt
        self.speed = max(before - change, target) if target < before else min(before + change, target)
        self.behind = self.behind * kept + 0.5 * (before + self.speed) * dt - made
        self.gained = self.gained * kept + self.speed - before
        self.stirred = self.stirred * kept + abs(self.speed - before)
        self.rate = (self.speed - before) / dt


class RampedWay:
    """Holds the present commanded velocity, and the axis's distance behind it (position increments, None: not known).

    ``lag``: the lag of the axis behind its commands in seconds, beyond ``delay``; None: not known.
    """

    __slots__ = (
        "_changed",
        "_delay",
        "_early",
        "_from_rest",
        "_late",
        "_on_ramp",
        "_per_velocity",
        "_position",
        "_settles_at",
        "_stamp",
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
        self._on_ramp = on_ramp
        self._early, self._late = (_Ramp(0.0, self._target, up, down) for _ in range(2))
        self.behind: float | None = None
        self.lag: float | None = None

    @property
    def speed(self) -> float:
        """The present commanded velocity in position increments per s; the higher of two while the drive may take a new one."""
        return max(self._early.speed, self._late.speed, key=abs)

    def aim(self, target: float) -> None:
        """Change to another target, in the drive's velocity increments."""
        self._target = target * self._per_velocity

    @property
    def began_at_rest(self) -> bool:
        """Whether the drive's commanded velocity is known: the motion began at standstill, and its position is known."""
        return self._from_rest and self.behind is not None

    def expect(self, up: float, down: float) -> None:
        """Allow for a drive that already uses the accelerations of the next command; units as in the constructor."""
        early, late = self._early, self._late
        early.up, early.down = max(early.up, up), max(early.down, down)
        late.up, late.down = min(late.up, up), min(late.down, down)

    def go_on(self, target: float, up: float, down: float) -> None:
        """Continue with another command, from the commanded velocity that the drive has by now; units as in the constructor."""
        for ramp in (self._early, self._late):
            ramp.up, ramp.down = up, down
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
            # With the accelerations that apply now, which are those of a new command already.
            ramps = (self._early, self._late)
            self._early, self._late = (_Ramp(speed, speed, ramp.up, ramp.down) for ramp in ramps)
            self._from_rest = image.standstill and not self._on_ramp
            self.behind, self._position, self._stamp = 0.0, position, stamp
            self._aim(image)
            return
        if self._early.target != self._target:
            self._aim(image)
        if stamp > self._stamp:
            self._advance(position, stamp - self._stamp)
            self._position, self._stamp = position, stamp

    def _aim(self, image: AxisImage) -> None:
        self._early.target = self._target
        self._late.aim(self._target, image.now + self._delay + image.velocity_transfer)

    def _advance(self, position: int, dt: float) -> None:
        self._late.take_up(self._stamp)
        made, kept = position - self._position, 1.0 - min(1.0, dt / self._memory())
        before = self._early.speed
        for ramp in (self._early, self._late):
            ramp.ramp(dt, made, kept)
        if self._early.speed != before:
            self._changed = self._stamp
        self._settle(self._stamp + dt)
        if self._from_rest and self._stamp - self._changed <= _LAG_TIME:
            self._take_lag(self._early)
        least, most = sorted((self._early.behind, self._late.behind))
        self.behind = least if least > 0.0 else min(most, 0.0)

    def _settle(self, now: float) -> None:
        if self._early.speed or self._late.speed:
            self._settles_at = now + _SETTLED
        elif now >= self._settles_at:
            self._settles_at = math.inf
            for ramp in (self._early, self._late):
                ramp.behind = ramp.gained = ramp.stirred = 0.0

    def _take_lag(self, ramp: _Ramp) -> None:
        if abs(ramp.gained) * _LAG_TIME <= NOISE:
            return  # too slow: an allowed lag would be within the noise
        if abs(ramp.gained) < _ONE_WAY * ramp.stirred:
            return
        way = max(0.0, math.copysign(ramp.behind, ramp.behind * ramp.gained) - NOISE)
        lag = way / abs(ramp.gained)
        if ramp.rate * ramp.gained > 0.0:
            lag = way / max(0.5 * abs(ramp.gained), abs(ramp.gained) - abs(ramp.rate) * lag)
        self.lag = min(max(0.0, lag - self._delay), _LAG_TIME)

    def _memory(self) -> float:
        """Return the decay time in seconds: twice the time in which an axis at standstill uses up the allowed difference."""
        fastest = max(abs(self.speed), abs(self._target))
        return min(_LONGEST, 2.0 * (self._window / fastest + _LAG_TIME)) if fastest else _LONGEST


def ramped_way(
    profile: MoveProfile, parameters: AxisParameters, before: RampedWay | None = None
) -> RampedWay | None:
    """Return the monitor of a velocity move; None if the drive's ramps, or the ratio of its units, are not known.

    ``before``: the monitor of the previous velocity, if the drive is on its ramp; it continues if it began at rest.
    """
    units = parameters.units
    if not profile.up or not profile.down or not parameters.has(objects.PROFILE_ACCELERATION):
        return None
    if before is not None and before.began_at_rest:
        before.go_on(profile.velocity, profile.up, profile.down)
        return before
    return RampedWay(
        profile.velocity,
        units.per_velocity,
        profile.up,
        profile.down,
        parameters.pull_window,
        _TAKEN * parameters.scan_period,
        on_ramp=before is not None and before.speed != 0.0,
    )


def led_way(parameters: AxisParameters) -> RampedWay | None:
    """Return the monitor of velocities generated by the master, each given with ``aim``; None if the unit ratio is not known."""
    units = parameters.units
    if not units.ratio_known:
        return None
    at_once = math.inf
    return RampedWay(
        0.0, units.per_velocity, at_once, at_once, parameters.pull_window, _TAKEN * parameters.scan_period
    )
