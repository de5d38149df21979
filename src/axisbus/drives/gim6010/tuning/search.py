"""The manual's way to a gain (v2.2, 3.1.3), one trial after the other: less until it is smooth, more until it is not, then less."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

from axisbus.drives.gim6010.tuning.advice import MORE, is_too_much, lowered
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
    """Holds the gain that is to be tried ``next`` (None: it is over, and ``ends`` says how), and the best that was smooth.

    ``first`` is tried first, and nothing above ``most``.

    Raises:
        ArgumentError: one of both is no gain above 0, or the first is above the other.
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
                f"{self.name}: from {self.first!r} up to {self.most!r}",
                remedy="give the gain to begin with, above 0, and one to which it may be raised, not below that",
            )
        self.next = self.first

    @property
    def name(self) -> str:
        """The gain's, as the firmware has it."""
        return _NAMES[self.loop]

    def take(self, response: Response) -> None:
        """Take what the step with the gain ``next`` was, the worse of both sides."""
        assert self.next is not None
        gain = self.next
        self.trials.append((gain, response))
        if is_too_much(self.loop, response):
            self._is_too_much(gain)
        else:
            self._is_smooth(gain)
        if self.next is not None and len(self.trials) >= MOST_TRIALS:
            self._end(f"after {MOST_TRIALS} trials it is given up")

    def _is_too_much(self, gain: float) -> None:
        if self._phase is _Phase.RAISING:
            self._phase = _Phase.LOWERING
        self.best = None  # what was smooth is not looked at as the manual has it: the gain comes from the one that is too much
        self.next = gain * lowered(self.loop)

    def _is_smooth(self, gain: float) -> None:
        self.best = gain
        if self._phase is _Phase.LOWERING:
            self._end(f"it is smooth with {self.name} {gain:.4g}, lowered from where it was not")
        elif gain * MORE > self.most:
            self._end(
                f"it is smooth with {self.name} {gain:.4g}, and may not be raised beyond {self.most:.4g}"
            )
        else:
            self._phase, self.next = _Phase.RAISING, gain * MORE

    def _end(self, text: str) -> None:
        self.next, self.ends = None, text
