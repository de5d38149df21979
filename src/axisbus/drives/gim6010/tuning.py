"""A trial of gains with one module: its parameters, the manual's search for a gain by trials, and its course.

Nothing has a default that moves the motor. The course is pure: frames and times in, requests out.

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
from dataclasses import dataclass, field, fields
from enum import Enum

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.codec import DecodedMessage, Outgoing, decode, encode, request
from axisbus.drives.gim6010.can_simple.identifier import require_node
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, IDLE, named
from axisbus.drives.gim6010.can_simple.orders import TRAPEZOID, VELOCITY
from axisbus.drives.gim6010.direct_motion import ModuleMotionProcedure, ModuleMotionStage
from axisbus.drives.gim6010.make import GEAR_RATIO
from axisbus.errors import ArgumentError
from axisbus.step_response import Response, measure

_POS_GAIN, _VEL_GAINS = named("Set_Pos_Gain"), named("Set_Vel_Gains")
_DEGREES = 360.0 / GEAR_RATIO
LONGEST = 30.0  # s for each half


class Loop(Enum):
    """The control loop whose gains are tried."""

    POSITION = "position"
    VELOCITY = "velocity"


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains in the firmware's units: (turns/s)/turn, N·m per turn/s, N·m per turn; None: unchanged.

    Raises:
        ArgumentError: a gain is below 0, or only one gain of the velocity loop is given: one message sets both.
    """

    position: float | None = None
    velocity: float | None = None
    integrator: float | None = None

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if value is not None and not 0.0 <= value < math.inf:
                raise ArgumentError(
                    f"{each.name} gain: {value!r} is not allowed", remedy="give a number that is not below 0"
                )
        if (self.velocity is None) is not (self.integrator is None):
            raise ArgumentError(
                "both gains of the velocity loop are set by one message",
                remedy="give --vel-gain and --vel-integrator-gain",
            )

    @property
    def given(self) -> dict[str, float]:
        """The gains that are to be changed, by name."""
        return {each.name: value for each in fields(self) if (value := getattr(self, each.name)) is not None}

    def frames(self, node: int) -> tuple[Outgoing, ...]:
        position = () if self.position is None else (encode(node, _POS_GAIN, {"Pos_Gain": self.position}),)
        if self.velocity is None or self.integrator is None:
            return position
        values = {"Vel_Gain": self.velocity, "Vel_Integrator_Gain": self.integrator}
        return (*position, encode(node, _VEL_GAINS, values))


@dataclass(frozen=True, slots=True)
class ModuleTrial:
    """A step there and back: ``size`` in rotor turns or rotor turns/s, of either sign; ``seconds`` is the duration of each half.

    The module reaches a position by a trapezoid of ``velocity`` (turns/s) and ``acceleration`` (turns/s²). It reaches a velocity by
    its own ramp (``vel_ramp_rate``), which no message sets; ``velocity`` and ``acceleration`` are then 0.

    Raises:
        ArgumentError: a value is invalid, or the step does not fit into its time.
    """

    node: int
    loop: Loop
    size: float
    seconds: float
    velocity: float = 0.0
    acceleration: float = 0.0

    def __post_init__(self) -> None:
        require_node(self.node)
        if not math.isfinite(self.size) or self.size == 0.0:
            raise ArgumentError(
                f"a step of {self.size!r} is not possible",
                remedy="give its size in turns of the rotor, or turns/s",
            )
        if not 0.0 < self.seconds <= LONGEST:
            raise ArgumentError(
                f"{self.seconds!r} s for each side is not allowed",
                remedy=f"give more than 0 and at most {LONGEST:g} s",
            )
        if self.loop is Loop.POSITION:
            self._check_trapezoid()

    def _check_trapezoid(self) -> None:
        if not (0.0 < self.velocity < math.inf and 0.0 < self.acceleration < math.inf):
            raise ArgumentError(
                f"velocity {self.velocity!r}, acceleration {self.acceleration!r}: a step of position needs both",
                remedy="give --velocity and --acceleration of the rotor, above 0",
            )
        if self.takes >= self.seconds:
            raise ArgumentError(
                f"the step takes {self.takes:.3g} s, and is recorded for {self.seconds:g} s",
                remedy="give more time, or a smaller step",
            )

    @property
    def takes(self) -> float:
        """Duration of its trapezoid in s; 0 for a step of velocity, whose ramp is unknown."""
        if self.loop is Loop.VELOCITY:
            return 0.0
        way, ramp = abs(self.size), self.velocity / self.acceleration
        if way >= self.velocity * ramp:
            return way / self.velocity + ramp
        return 2.0 * math.sqrt(way / self.acceleration)

    @property
    def farthest(self) -> float:
        """Rotor turns from the start at which the trial is aborted."""
        if self.loop is Loop.POSITION:
            return 1.5 * abs(self.size) + 0.1
        return 1.5 * abs(self.size) * self.seconds + 0.5

    @property
    def fastest(self) -> float:
        """Rotor turns/s at which the trial is aborted."""
        return 2.0 * (self.velocity if self.loop is Loop.POSITION else abs(self.size)) + 0.5


def explanation(trial: ModuleTrial) -> Iterator[str]:
    """Yield the motion to expect and the precautions."""
    yield f"a step of the {trial.loop.value} of module {trial.node}, which enables it and turns it:"
    degrees = f"{trial.size * _DEGREES:.4g} degrees"
    if trial.loop is Loop.POSITION:
        yield (
            f"  the rotor goes by {trial.size:g} rotor turns ({degrees} of the output at {GEAR_RATIO}:1) and back again, with "
            f"{trial.velocity:g} turns/s"
        )
    else:
        yield (
            f"  the rotor turns at {trial.size:g} turns/s ({degrees}/s of the output at {GEAR_RATIO}:1) for {trial.seconds:g} s, "
            "on the module's own ramp, and does not come back"
        )
    yield (
        f"  it is ended farther than {trial.farthest:.3g} rotor turns from its present position "
        f"({trial.farthest * _DEGREES:.4g} degrees of the output), and faster than {trial.fastest:.3g} turns/s"
    )
    yield "  gains that are too high shake the machine: keep the switch of the supply within reach, and its range of motion free"
    yield (
        "  Ctrl-C brakes the rotor and switches the power off; if the program is killed, the module continues with its last "
        "command. Nothing is saved"
    )


# -- The manual's search for a gain (v2.2, 3.1.3) by trials: lower it until smooth, raise it until not, then lower it ---


MOST_TRIALS = 25
_NAMES = {Loop.VELOCITY: "vel_gain", Loop.POSITION: "pos_gain"}


class _Phase(Enum):
    SMOOTHING = "less, until it is smooth"
    RAISING = "more, until it is not"
    LOWERING = "less, until it is smooth again"


@dataclass(slots=True)
class GainSearch:
    """The gain to try ``next`` (None: the search is over, and ``ends`` is the result), and the best smooth gain.

    ``first`` is tried first; no gain is above ``most``.

    Raises:
        ArgumentError: a gain is not above 0, or the first is above the highest.
    """

    loop: Loop
    first: float
    most: float
    best: float | None = None
    ends: str = ""
    trials: list[tuple[float, Response]] = field(default_factory=list)
    next: float | None = None
    _phase: _Phase = _Phase.SMOOTHING

    def __post_init__(self) -> None:
        if not 0.0 < self.first <= self.most < math.inf:
            raise ArgumentError(
                f"{self.name}: gains from {self.first!r} up to {self.most!r} are not a range",
                remedy="give a first gain above 0, and a highest gain that is not below it",
            )
        self.next = self.first

    @property
    def name(self) -> str:
        return _NAMES[self.loop]

    def take(self, response: Response) -> None:
        """Take the response to the gain ``next``, the worse of both halves."""
        assert self.next is not None
        gain = self.next
        self.trials.append((gain, response))
        if is_too_much(self.loop, response):
            self._is_too_much(gain)
        else:
            self._is_smooth(gain)
        if self.next is not None and len(self.trials) >= MOST_TRIALS:
            self._end(f"after {MOST_TRIALS} trials the search is given up")

    def _is_too_much(self, gain: float) -> None:
        if self._phase is _Phase.RAISING:
            self._phase = _Phase.LOWERING
        # The manual does not go back to the last smooth gain: it derives the next gain from the one that was too high.
        self.best = None
        self.next = gain * lowered(self.loop)

    def _is_smooth(self, gain: float) -> None:
        self.best = gain
        if self._phase is _Phase.LOWERING:
            self._end(f"it is smooth with {self.name} {gain:.4g}, lowered from a gain with which it was not")
        elif gain * MORE > self.most:
            self._end(
                f"it is smooth with {self.name} {gain:.4g}, and may not be raised beyond {self.most:.4g}"
            )
        else:
            self._phase, self.next = _Phase.RAISING, gain * MORE

    def _end(self, text: str) -> None:
        self.next, self.ends = None, text


# -- The manual's advice on the next gain (v2.2, 3.1.3): raise it until it oscillates or overshoots, then lower it -----


MORE, LESS, HALF = 1.3, 0.85, 0.5
_RIPPLE = 0.1  # share of the step: more counts as an oscillation
_OVERSHOOT = 0.05  # share of the step


def is_too_much(loop: Loop, response: Response) -> bool:
    """Return whether the gain is too high: the step oscillates or does not settle, or, for a position, overshoots."""
    if loop is Loop.VELOCITY:
        return response.ripple > _RIPPLE or response.settled is None
    return response.overshoot > _OVERSHOOT or response.ripple > _RIPPLE


def lowered(loop: Loop) -> float:
    """Return the factor by which a too high gain of a loop is lowered."""
    return HALF if loop is Loop.VELOCITY else LESS


def worse(*responses: Response | None) -> Response | None:
    """Return the worst of the measured responses, or None without any."""
    return max(
        (each for each in responses if each is not None),
        key=lambda each: (each.settled is None, each.overshoot + each.ripple),
        default=None,
    )


def following(loop: Loop, response: Response, gain: float | None) -> str:
    """Return the next step as text; ``gain`` is the gain tried (vel_gain or pos_gain), None if unknown."""
    more, less = _value(gain, MORE), _value(gain, lowered(loop))
    if loop is Loop.VELOCITY:
        if is_too_much(loop, response):
            return f"it oscillates or does not settle: vel_gain is halved{less}"
        return f"it is smooth: vel_gain may be raised by 30 %{more} until it oscillates, and halved then"
    if is_too_much(loop, response):
        return f"it overshoots: pos_gain is lowered little by little{less} until it does not"
    return f"it does not overshoot: pos_gain may be raised by 30 %{more} until it does, and lowered then"


def _value(gain: float | None, factor: float) -> str:
    return "" if not gain else f", to {gain * factor:.4g}"


# -- A trial with one module, from the first heartbeat to its end ------------------------------------------------------


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
            # velocity first, or the earlier one would apply for a moment
            self._queue.extend([self._orders.velocity(0.0), self._orders.mode(VELOCITY)])
        return self._queue.popleft()

    # Frames.

    def _ready(self) -> Iterator[Outgoing]:
        """Yield the frames that prepare an idle module for closed loop; they overwrite all earlier inputs."""
        trial, orders = self.trial, self._orders
        if trial.loop is Loop.POSITION:
            yield from orders.profile(trial.velocity, trial.acceleration, trial.acceleration)
        yield orders.velocity(0.0)
        yield orders.mode(_MODES[trial.loop])
