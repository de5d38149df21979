"""A trial of gains with one module, from the first heartbeat to its end; pure: frames and times in, requests out.

Theory of operation
-------------------
The gains and the mode are set in idle. A position is reached by a trapezoid and a velocity by a ramp; direct control is never used,
because modules ran away in it. Closed loop is requested once and must appear in the heartbeat, followed by an estimate of the
position. Then the step is sent and measured, and taken back and measured, too. Every trial ends in the same way: velocity 0 on the
module's own ramp until standstill (at most 2 s), then idle, or ESTOP if idle is not seen in time (``ModuleMotionProcedure``).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from enum import Enum

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.codec import DecodedMessage, Outgoing, decode, request
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, IDLE, named
from axisbus.drives.gim6010.can_simple.orders import TRAPEZOID, VELOCITY
from axisbus.drives.gim6010.direct_motion import ModuleMotionProcedure, ModuleMotionStage
from axisbus.drives.gim6010.tuning.trial import Gains, Loop, ModuleTrial
from axisbus.step_response import Response, measure

_ESTIMATES = named("Get_Encoder_Estimates")
_MODES = {Loop.POSITION: TRAPEZOID, Loop.VELOCITY: VELOCITY}
START_TIME = 2.0  # s until a heartbeat must show closed loop
_SAMPLE = 0.005  # s between two requests for the estimate
_DEAF = 0.25  # s without an estimate
_AGAIN = 0.05  # s between two brake commands
_STANDS = 0.05  # turns/s: standstill


class TuningPhase(Enum):
    """Phase of a trial."""

    PREPARING = "being made ready"
    STARTING = "waiting for closed loop"
    THERE = "during the move there"
    BACK = "during the move back"


_STATES = {
    TuningPhase.PREPARING: (IDLE,),
    TuningPhase.STARTING: (IDLE, CLOSED_LOOP),
    TuningPhase.THERE: (CLOSED_LOOP,),
    TuningPhase.BACK: (CLOSED_LOOP,),
}


class ModuleTuning(ModuleMotionProcedure):
    """One trial with its measurements. ``there`` and ``back`` are the responses, None if the trial ended before them."""

    def __init__(self, trial: ModuleTrial, gains: Gains, *, remote: bool = True) -> None:
        """``remote``: whether the bus carries remote frames."""
        super().__init__(trial.node)
        self.trial = trial
        self.there: Response | None = None
        self.back: Response | None = None
        self.ended = False  # complete, not interrupted
        self._remote = remote
        self._phase = TuningPhase.PREPARING
        self._queue: deque[Outgoing] = deque(
            [*gains.frames(trial.node), *self._ready(), self._orders.closed_loop()]
        )
        self._at = 0.0  # when the phase began
        self._place: tuple[float, float, float] | None = None  # time, position, velocity
        self._home = 0.0
        self._samples: list[tuple[float, float]] = []
        self._asked = self._braked = -math.inf

    # Reception.

    def _hear(self, command: int, frame: CanFrame) -> None:
        if command != _ESTIMATES.command or self.stage in (
            ModuleMotionStage.LISTENING,
            ModuleMotionStage.DONE,
        ):
            return
        found = decode(frame.can_id, frame.data, from_module=True)
        last = self._pulse.last
        alive = last is not None and last.state == CLOSED_LOOP
        if not isinstance(found, DecodedMessage) or not alive:  # the estimate is invalid outside closed loop
            return
        position, velocity = (float(found.values[each]) for each in ("Pos_Estimate", "Vel_Estimate"))
        self._place = (frame.time, position, velocity)
        if self.stage is ModuleMotionStage.LED and self._phase in (TuningPhase.THERE, TuningPhase.BACK):
            self._samples.append(
                (frame.time - self._at, position if self.trial.loop is Loop.POSITION else velocity)
            )
            self._watch(position, velocity)

    def _follow(self, time: float) -> None:
        """Nothing to do: each step evaluates the last heartbeat."""

    def _watch(self, position: float, velocity: float) -> None:
        if not math.isfinite(position + velocity):
            self._end("its position is not a number")
        elif abs(position - self._home) > self.trial.farthest:
            self._end(
                f"it is {abs(position - self._home):.3g} rotor turns from its start position, farther than allowed"
            )
        elif abs(velocity) > self.trial.fastest:
            self._end(f"it turns at {abs(velocity):.3g} turns/s, faster than it may")

    # Sending.

    def _begin(self) -> Outgoing:
        return self._queue.popleft()

    def _lead(self, now: float) -> Outgoing | None:
        if self._against(now, *_STATES[self._phase]):
            return None
        if self._phase is TuningPhase.PREPARING:
            return self._prepare(now)
        if self._phase is TuningPhase.STARTING:
            return self._start(now)
        return self._move(now)

    def _prepare(self, now: float) -> Outgoing:
        frame = self._queue.popleft()
        if not self._queue:
            self._phase, self._at, self._to_brake = TuningPhase.STARTING, now, True
        return frame

    def _start(self, now: float) -> Outgoing | None:
        last = self._pulse.last
        seen = last is not None and last.state == CLOSED_LOOP and self._pulse.at > self._at
        if seen and self._place is not None:
            self._home = self._place[1]
            self.news.append("it is enabled and at standstill; the step begins")
            return self._go(TuningPhase.THERE, now)
        if now - self._at > START_TIME + 2.0 * self._pulse.period:
            self._end("the module does not enter closed loop, or does not report its position in it")
            return None
        return self._ask(now)

    def _go(self, phase: TuningPhase, now: float) -> Outgoing:
        self._phase, self._at, self._samples = phase, now, []
        target = self.trial.size if phase is TuningPhase.THERE else 0.0
        if self.trial.loop is Loop.VELOCITY:
            return self._orders.velocity(target)
        return self._orders.position(self._home + target)

    def _move(self, now: float) -> Outgoing | None:
        if self._place is None or now - max(self._place[0], self._at) > _DEAF:
            self._end("the module no longer reports its position")
        elif now - self._at >= self.trial.seconds:
            return self._next(now)
        else:
            return self._ask(now)
        return None

    def _next(self, now: float) -> Outgoing | None:
        start, target = (0.0, self.trial.size) if self._phase is TuningPhase.THERE else (self.trial.size, 0.0)
        if self.trial.loop is Loop.POSITION:
            start, target = start + self._home, target + self._home
        found = measure(self._samples, start, target)
        if self._phase is TuningPhase.THERE:
            self.there = found
            return self._go(TuningPhase.BACK, now)
        self.back, self.ended = found, True
        self._end("")
        return None

    def _ask(self, now: float) -> Outgoing | None:
        if now - self._asked < _SAMPLE:
            return None
        self._asked = now
        return request(self.node, _ESTIMATES, remote=self._remote)

    def _brake(self, now: float) -> Outgoing | None:
        """Command velocity 0 on the module's own ramp, until standstill, power off or time-out."""
        place = self._place
        stands = place is not None and now - place[0] < _DEAF and abs(place[2]) <= _STANDS
        if self._has_braked(now, stands=stands):
            return None
        if not self._queue and now - self._braked < _AGAIN:
            return self._ask(now)
        if not self._queue:
            self._braked = now
            self._queue.extend(self._stopping())
        return self._queue.popleft()

    # Frames.

    def _ready(self) -> Iterator[Outgoing]:
        """Yield the frames that prepare an idle module for closed loop; they overwrite all earlier inputs."""
        trial, orders = self.trial, self._orders
        if trial.loop is Loop.POSITION:
            yield from orders.profile(trial.velocity, trial.acceleration, trial.acceleration)
        yield orders.velocity(0.0)
        yield orders.mode(_MODES[trial.loop])

    def _stopping(self) -> Iterator[Outgoing]:
        """Yield the frames that brake on the module's own ramp; velocity first, or the earlier one would apply for a moment."""
        yield self._orders.velocity(0.0)
        yield self._orders.mode(VELOCITY)
