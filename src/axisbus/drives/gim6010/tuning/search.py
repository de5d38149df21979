"""The manual's search for a gain (v2.2, 3.1.3) by trials: lower it until smooth, raise it until not, then lower it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

from axisbus.drives.gim6010.tuning.trial import Loop
from axisbus.errors import ArgumentError
from axisbus.step_response import Response

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
        """Name of the gain in the firmware."""
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
