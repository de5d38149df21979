"""The result of a trial: its figures in words, and its samples for the diagram."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from axisbus.errors import AxisbusError
from axisbus.motion.parameters import AxisParameters
from axisbus.web.tuning.metrics import goal, since, told
from axisbus.web.tuning.step import TuningStep, TuningStepKind
from axisbus.web.tuning.trial import TrialPhase, TrialSide, TuningTrial
from axisbus.web.view.axes import Values, explained

_SIDES = (TrialPhase.THERE, TrialPhase.BACK)


@dataclass(frozen=True, slots=True)
class TrialOutcome:
    """A finished trial: ``told`` is the report for its page, ``sides`` are the recorded sides."""

    told: Values
    step: TuningStep
    unit: str
    sides: tuple[tuple[TrialPhase, TrialSide], ...]

    def samples(self) -> Values:
        """Return all cycles, in the units of the step's quantity; unknown values are None. May take a tenth of a second."""
        return {
            "number": self.told["number"],
            "axis": self.step.axis,
            "kind": self.step.kind.value,
            "unit": self.unit,
            "text": self.told["text"],
            **{phase.value: _drawn(self.step, phase, side) for phase, side in self.sides},
        }


def outcome(
    number: int, trial: TuningTrial, parameters: AxisParameters, error: AxisbusError | None
) -> TrialOutcome:
    """Return the result of a finished trial; a disturbed trial has no figures."""
    step, units = trial.step, parameters.units
    of = units.velocity.unit if step.kind is TuningStepKind.VELOCITY else units.position.unit
    whole = not trial.why
    sides = tuple((phase, trial.sides[phase]) for phase in _SIDES if phase in trial.sides)
    values: Values = {
        "number": number,
        "axis": step.axis,
        "phase": TrialPhase.OVER.value,
        "text": _text(step, of, units.position.unit),
        "why": trial.why,
        "error": None if error is None else explained(error),
        "samples": sum(len(side.points) for _, side in sides),
        "figures": {phase.value: told(step, phase, side, (of, units.position.unit)) for phase, side in sides}
        if whole
        else {},
    }
    return TrialOutcome(values, step, of, sides)


def _text(step: TuningStep, of: str, unit: str) -> str:
    fast = f", {step.velocity:g} {unit}/s" if step.kind is TuningStepKind.POSITION else ""
    return f"{step.kind.value} {step.size:g} {of}{fast}, {step.acceleration:g} {unit}/s², {step.seconds:g} s"


def _drawn(step: TuningStep, phase: TrialPhase, side: TrialSide) -> Values:
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
