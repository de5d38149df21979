"""The result of a trial: its figures in words, and its samples for the diagram."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from axisbus.errors import AxisbusError
from axisbus.motion.parameters import AxisParameters
from axisbus.step_response import BAND, Response, measure
from axisbus.web.tuning.step import TuningStep, TuningStepKind
from axisbus.web.tuning.trial import TrialPhase, TrialSample, TrialSide, TuningTrial
from axisbus.web.view import Values, explained

_SIDES = (TrialPhase.THERE, TrialPhase.BACK)


@dataclass(frozen=True, slots=True)
class TrialOutcome:
    """A finished trial: ``report`` is the report for its page, ``sides`` are the recorded sides."""

    report: Values
    step: TuningStep
    unit: str
    sides: tuple[tuple[TrialPhase, TrialSide], ...]

    def samples(self) -> Values:
        """Return all cycles, in the units of the step's quantity; unknown values are None. May take a tenth of a second."""
        return {
            "number": self.report["number"],
            "axis": self.step.axis,
            "kind": self.step.kind.value,
            "unit": self.unit,
            "text": self.report["text"],
            **{phase.value: _plotted(self.step, phase, side) for phase, side in self.sides},
        }


def outcome(
    number: int, trial: TuningTrial, parameters: AxisParameters, error: AxisbusError | None
) -> TrialOutcome:
    """Return the result of a finished trial; a disturbed trial has no figures."""
    step, units = trial.step, parameters.units
    of = units.velocity.unit if step.kind is TuningStepKind.VELOCITY else units.position.unit
    undisturbed = not trial.why
    sides = tuple((phase, trial.sides[phase]) for phase in _SIDES if phase in trial.sides)
    values: Values = {
        "number": number,
        "axis": step.axis,
        "phase": TrialPhase.OVER.value,
        "text": _text(step, of, units.position.unit),
        "why": trial.why,
        "error": None if error is None else explained(error),
        "samples": sum(len(side.points) for _, side in sides),
        "figures": {
            phase.value: report(step, phase, side, (of, units.position.unit)) for phase, side in sides
        }
        if undisturbed
        else {},
    }
    return TrialOutcome(values, step, of, sides)


def _text(step: TuningStep, of: str, unit: str) -> str:
    fast = f", {step.velocity:g} {unit}/s" if step.kind is TuningStepKind.POSITION else ""
    return f"{step.kind.value} {step.size:g} {of}{fast}, {step.acceleration:g} {unit}/s², {step.seconds:g} s"


def _plotted(step: TuningStep, phase: TrialPhase, side: TrialSide) -> Values:
    """Return the columns of a side; a velocity step has its commanded velocity as target, and no demand."""
    found = since(side)
    points = [point for _, point in found]
    position = step.kind is TuningStepKind.POSITION
    start, target = goal(step, phase, side)
    commanded = [target if at >= 0.0 else start for at, _ in found]
    return {
        "times": [round(at, 6) for at, _ in found],
        "actual": _known([point.actual for point in points]),
        "target": commanded,
        "demand": _known([point.demand for point in points]) if position else [None] * len(points),
    }


def _known(values: Sequence[float]) -> list[float | None]:
    return [None if math.isnan(value) else value for value in values]


# -- The figures of one side of a trial, in words: overshoot, settling, ripple, rest, and the highest following error ----


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
    if side.started is None:
        return []
    return [(point.time - side.started, point) for point in side.points]


def highest_error(points: Sequence[TrialSample]) -> float | None:
    """Return the highest magnitude of the following error; None if it is unknown."""
    return max((abs(point.error) for point in points if not math.isnan(point.error)), default=None)


def report(step: TuningStep, phase: TrialPhase, side: TrialSide, units: tuple[str, str]) -> dict[str, str]:
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
