"""Speed and acceleration of a count, from its last samples."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

from axisbus.motion.position_limits import NOISE

_KEPT = 7  # samples: six velocities, of which the medians of the older and of the newer three give the acceleration


class VelocityEstimator:
    """The last samples of one count (increments over seconds); holds them.

    A frame that is taken from the adapter late makes one difference too slow and the next one too fast. The median of three sees
    neither, so that a busy computer's jitter does not look like danger.
    """

    __slots__ = ("_motion", "_recounts", "_samples")

    def __init__(self) -> None:
        self._samples: deque[tuple[float, int]] = deque(maxlen=_KEPT)
        self._motion: tuple[float, float] | None = None
        self._recounts = False

    def recount(self) -> None:
        """The next sample counts from another place, and the count was at rest: the samples before it take its value.

        A track that began again would know no velocity for two samples, in which an axis with slow feedback leaves its limits.
        """
        self._recounts = True

    def take(self, value: int | None, stamp: float) -> None:
        """Take a sample; None ends the track, one that is known already changes nothing."""
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
        """Whether there is a velocity."""
        return len(self._samples) > 2

    @property
    def mean(self) -> float:
        """Mean velocity (per s) over all samples that are kept."""
        samples = self._samples
        return (samples[-1][1] - samples[0][1]) / (samples[-1][0] - samples[0][0])

    def toward(self, direction: int) -> float:
        """Return how fast (per s) the count may go in ``direction`` (1 or -1), by its last samples.

        A count is a whole number. A slow one changes by 1, 1 and 2 between samples, and the median of these is too low by up to one
        count. The mean over all samples is better there, so it counts up to that much.
        """
        velocity = self.motion[0] * direction
        return max(velocity, min(self.mean * direction, velocity + 1.0 / self.spacing))

    @property
    def least(self) -> float:
        """The lowest speed (per s) that the count may have had over the last three differences, if it wanders by ``NOISE``."""
        samples = self._samples
        first = samples[-min(len(samples), 4)]
        seconds = samples[-1][0] - first[0]
        return max(0.0, min(abs(self.motion[0]), (abs(samples[-1][1] - first[1]) - NOISE) / seconds))

    @property
    def gone(self) -> int:
        """How far the count has gone over all samples that are kept."""
        return self._samples[-1][1] - self._samples[0][1]

    @property
    def value(self) -> int:
        """The last sample's value."""
        return self._samples[-1][1]

    @property
    def spacing(self) -> float:
        """Mean seconds between two samples."""
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
        if len(speeds) < _KEPT - 1:
            return velocity, 0.0
        return velocity, (velocity - sorted(speeds[:3])[1]) / (3.0 * self.spacing)
