"""The figures of one side of a trial, in words: overshoot, settling, ripple, rest, and the highest following error."""

from __future__ import annotations

import math
from collections.abc import Sequence

from axisbus.step_response import BAND, Response, measure
from axisbus.web.tuning.step import TuningStep, TuningStepKind
from axisbus.web.tuning.trial import TrialPhase, TrialSample, TrialSide

FIGURES = (
    ("overshoot", "Overshoot"),
    ("settled", f"Settled within {BAND * 100:g} %"),
    ("ripple", "Ripple at the end"),
    ("rest", "Rest at the end"),
    ("error", "Highest following error"),
)


def goal(step: TuningStep, phase: TrialPhase, side: TrialSide) -> tuple[float, float]:
    """Return start and target of a side, in the quantity of the step."""
    if step.kind is TuningStepKind.VELOCITY:
        return (0.0, step.size) if phase is TrialPhase.THERE else (step.size, 0.0)
    start, target = side.sent.actual, side.points[-1].target
    if phase is TrialPhase.BACK and not math.isnan(side.sent.target):
        start = side.sent.target
    if math.isnan(target):
        target = start + (step.size if phase is TrialPhase.THERE else -step.size)
    return start, target


def measured(step: TuningStep, phase: TrialPhase, side: TrialSide) -> Response | None:
    """Measure a side from its observed beginning; None if too little was seen."""
    start, target = goal(step, phase, side)
    return measure([(at, point.actual) for at, point in since(side) if at >= 0.0], start, target)


def since(side: TrialSide) -> list[tuple[float, TrialSample]]:
    """Return the points of a side with their times from its observed beginning; empty if it has not begun."""
    if side.begun is None:
        return []
    return [(point.time - side.begun, point) for point in side.points]


def highest_error(points: Sequence[TrialSample]) -> float | None:
    """Return the highest magnitude of the following error; None if it is unknown."""
    return max((abs(point.error) for point in points if not math.isnan(point.error)), default=None)


def told(step: TuningStep, phase: TrialPhase, side: TrialSide, units: tuple[str, str]) -> dict[str, str]:
    """Return the figures of a side by name; ``units`` are those of the step's quantity and of positions."""
    found, error = measured(step, phase, side), highest_error(side.points)
    lag = "unknown" if error is None else f"{error:.4g} {units[1]}"
    if found is None:
        return {name: "unknown" for name, _ in FIGURES} | {"error": lag}
    size = abs(step.size)
    return {
        "overshoot": _part(found.overshoot, size, units[0]),
        "settled": "not settled" if found.settled is None else f"{found.settled:.3f} s",
        "ripple": _part(found.ripple, size, units[0]),
        "rest": _part(found.left, size, units[0]),
        "error": lag,
    }


def _part(part: float, size: float, unit: str) -> str:
    return f"{part * 100:.1f} % ({part * size:.3g} {unit})"
