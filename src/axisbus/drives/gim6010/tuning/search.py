"""The manual's search for a gain (v2.2, 3.1.3) by trials: lower it until smooth, raise it until not, then lower it."""

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
                f"{self.name}: from {self.first!r} up to {self.most!r}",
                remedy="give the gain to begin with, above 0, and one to which it may be raised, not below that",
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
            self._end(f"after {MOST_TRIALS} trials it is given up")

    def _is_too_much(self, gain: float) -> None:
        if self._phase is _Phase.RAISING:
            self._phase = _Phase.LOWERING
        self.best = None  # the manual does not return to the smooth gain: the next one is derived from the one that was too high
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
