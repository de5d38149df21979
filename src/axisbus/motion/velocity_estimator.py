"""Estimate velocity and acceleration of a count from its last samples."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

from axisbus.motion.parameters import NOISE

# samples: six velocities; the medians of the older and the newer three give the acceleration
_MAX_SAMPLES = 7


class VelocityEstimator:
    """Stores the last samples of one count (increments over seconds).

    A frame that is read late from the adapter makes one difference too slow and the next one too fast. The median of three
    suppresses both, so that the jitter of a busy computer does not look like danger.
    """

    __slots__ = ("_motion", "_recounts", "_samples")

    def __init__(self) -> None:
        self._samples: deque[tuple[float, int]] = deque(maxlen=_MAX_SAMPLES)
        self._motion: tuple[float, float] | None = None
        self._recounts = False

    def recount(self) -> None:
        """Announce that the next sample counts from another origin, with the count at rest: earlier samples are set to its value.

        If the track restarted instead, it would have no velocity for two samples; an axis with slow feedback could leave its
        limits.
        """
        self._recounts = True

    def take(self, value: int | None, stamp: float) -> None:
        """Add a sample; None ends the track, and a sample that is already known has no effect."""
        samples = self._samples
        if value is None:
            samples.clear()
        elif not samples or stamp > samples[-1][0]:
            if self._recounts:
                self._recounts = False
                for number, (before, _) in enumerate(samples):
                    samples[number] = before, value
            samples.append((stamp, value))
            self._motion = None

    @property
    def is_known(self) -> bool:
        """Whether a velocity is known."""
        return len(self._samples) > 2

    @property
    def mean(self) -> float:
        """Mean velocity (per s) over all stored samples."""
        samples = self._samples
        return (samples[-1][1] - samples[0][1]) / (samples[-1][0] - samples[0][0])

    def toward(self, direction: int) -> float:
        """Return the velocity (per s) that the count may have in ``direction`` (1 or -1), from its last samples.

        A count is a whole number. A slow one changes by 1, 1 and 2 between samples, and the median of these is too low by up to one
        count. The mean over all samples is better in this case, so it is used up to that deviation.
        """
        velocity = self.motion[0] * direction
        return max(velocity, min(self.mean * direction, velocity + 1.0 / self.spacing))

    @property
    def least(self) -> float:
        """The lowest possible speed (per s) over the last three differences: the count has ``NOISE``, and its stamps are not exact.

        A frame that waits for others on the bus has a late stamp: two stamps may each be off by as much as one spacing differs from
        the mean.
        """
        samples = self._samples
        first = samples[-min(len(samples), 4)]
        spacing = self.spacing
        off = max(abs(after - before - spacing) for (before, _), (after, _) in pairwise(samples))
        seconds = samples[-1][0] - first[0] + 2.0 * off
        return max(0.0, min(abs(self.motion[0]), (abs(samples[-1][1] - first[1]) - NOISE) / seconds))

    @property
    def change(self) -> int:
        """The change of the count over all stored samples."""
        return self._samples[-1][1] - self._samples[0][1]

    @property
    def value(self) -> int:
        """The value of the last sample."""
        return self._samples[-1][1]

    @property
    def spacing(self) -> float:
        """Mean time between two samples in seconds."""
        samples = self._samples
        return (samples[-1][0] - samples[0][0]) / (len(samples) - 1)

    @property
    def motion(self) -> tuple[float, float]:
        """Velocity (per s), one and a half ``spacing`` before the last sample, and acceleration (per s²)."""
        if self._motion is None:
            self._motion = self._measured()
        return self._motion

    def _measured(self) -> tuple[float, float]:
        speeds = [
            (value - old) / (stamp - before) for (before, old), (stamp, value) in pairwise(self._samples)
        ]
        if len(speeds) < 3:
            return min(speeds, key=abs), 0.0
        velocity = sorted(speeds[-3:])[1]
        if len(speeds) < _MAX_SAMPLES - 1:
            return velocity, 0.0
        return velocity, (velocity - sorted(speeds[:3])[1]) / (3.0 * self.spacing)
