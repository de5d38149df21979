"""Parameters of a trial, and the manual's search for a gain by trials; nothing has a default that moves the motor."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from enum import Enum

from axisbus.drives.gim6010.can_simple.codec import Outgoing, encode
from axisbus.drives.gim6010.can_simple.identifier import require_node
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.make import GEAR_RATIO
from axisbus.errors import ArgumentError
from axisbus.step_response import Response

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
        self.best = None  # the manual does not return to the smooth gain: the next one is derived from the one that was too high
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
