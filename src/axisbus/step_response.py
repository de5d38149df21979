"""Evaluate a step response: overshoot, settling and ripple, from samples and the requested step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

BAND = 0.02  # of the step; within it the value has settled
_LEAST = 10  # samples
END = 1.0 / 3.0  # of the time, over which the ripple is measured


@dataclass(frozen=True, slots=True)
class Response:
    """One step: ``overshoot`` and ``ripple`` (peak to peak at the end) as parts of the step, ``settled`` in s, None if not settled.

    ``left`` is the mean remaining error at the end, as a part of the step; ``samples`` is the number of samples.
    """

    overshoot: float
    settled: float | None
    ripple: float
    left: float
    samples: int

    def __str__(self) -> str:
        settled = "not settled" if self.settled is None else f"settled after {self.settled:.3f} s"
        return (
            f"overshoot {self.overshoot:.1%}, {settled} (within {BAND:.0%}), ripple {self.ripple:.1%}, "
            f"{self.left:+.1%} left at the end"
        )


def measure(samples: Sequence[tuple[float, float]], start: float, target: float) -> Response | None:
    """Measure a step from ``start`` to ``target`` at the time 0; samples are (s, value), oldest first.

    None if there are too few samples, or the step is 0.
    """
    step = target - start
    if step == 0.0 or len(samples) < _LEAST:
        return None
    values = [(time, (value - start) / step) for time, value in samples]
    until = values[-1][0]
    end = [value for time, value in values if time >= until * (1.0 - END)]
    outside = [number for number, (_, value) in enumerate(values) if abs(value - 1.0) > BAND]
    first = 0 if not outside else outside[-1] + 1
    return Response(
        max(0.0, max(value for _, value in values) - 1.0),
        values[first][0] if first < len(values) else None,
        max(end) - min(end),
        1.0 - sum(end) / len(end),
        len(values),
    )
