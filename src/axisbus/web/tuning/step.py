"""The step of a trial: a step of position or of velocity, checked before the axis moves, and its question for the user."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import ArgumentError, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.request import AxisCall
from axisbus.motion.parameters import AxisLimits, AxisParameters
from axisbus.motion.states import REFUSAL, AxisState
from axisbus.step_response import END

LONGEST = 10.0  # s for each side
_MOVES = "moves", "wait for its end, or halt it first: axis.halt()"


class TuningStepKind(Enum):
    """The quantity of the step."""

    POSITION = "position"
    VELOCITY = "velocity"


@dataclass(frozen=True, slots=True)
class TuningStep:
    """A step there and back, in the axis's units; no value has a default.

    ``size`` is signed, a distance or a velocity. ``velocity`` is the velocity of a step of position, or the magnitude of a step of
    velocity. Each side is observed for ``seconds``.
    """

    axis: str
    kind: TuningStepKind
    size: float
    velocity: float
    acceleration: float
    seconds: float

    @classmethod
    def of(cls, axis: str, values: Mapping[str, float]) -> TuningStep:
        """Return the step for the values of a page: a step of position if there is a distance."""
        velocity, acceleration, seconds = (values[each] for each in ("velocity", "acceleration", "seconds"))
        if "distance" in values:
            return cls(axis, TuningStepKind.POSITION, values["distance"], velocity, acceleration, seconds)
        return cls(axis, TuningStepKind.VELOCITY, velocity, abs(velocity), acceleration, seconds)

    def expected_time(self, override: float = 1.0) -> float:
        """Return the seconds that one side takes if the axis follows its profile; ``override`` (> 0) multiplies its velocity."""
        velocity = self.velocity * override
        ramp = velocity / self.acceleration
        if self.kind is TuningStepKind.VELOCITY:
            return ramp
        distance = abs(self.size)
        if distance >= velocity * ramp:
            return distance / velocity + ramp
        return 2.0 * math.sqrt(distance / self.acceleration)


def question(step: TuningStep, axis: Axis, parameters: AxisParameters) -> str:
    """Return the question to ask before a step: which axis moves, how far and how fast, and within which limits.

    Raises:
        ArgumentError, LimitError: a value is invalid or too high, or the step does not fit into its time.
        StateError: the axis is not enabled at standstill, or its drive does not support the mode.
        StaleError: the position is unknown.
    """
    unit, text = (
        axis.unit,
        f"step({step.size:g} {axis.unit}{'/s' if step.kind is TuningStepKind.VELOCITY else ''})",
    )
    _require_ready(step, axis, f"{axis.name}.{text}")
    override = axis.total_override
    _require_values(step, override, AxisCall(parameters, text))
    start = axis.position
    position_known = axis.homed or not parameters.homing.required
    limits = f"Its limits: {_limits(axis.limits, unit, '' if position_known else ', after homing')}."
    if step.kind is TuningStepKind.VELOCITY:
        travel = abs(step.size) * override * (step.seconds + step.expected_time(override))
        return (
            f"Turn {axis.name} at {_speed(step.size, override, unit)}, with {step.acceleration:g} {unit}/s², and stop it after "
            f"{step.seconds:g} s? It goes from {start:.3f} {unit} by up to {travel:.4g} {unit}, and does not come back. {limits}"
        )
    if axis.modulo is None and position_known:
        AxisCall(parameters, text).target(start + step.size)
    return (
        f"Move {axis.name} by {step.size:g} {unit}, from {start:.3f} to {start + step.size:.3f} {unit}, at up to "
        f"{_speed(step.velocity, override, unit)} with {step.acceleration:g} {unit}/s², and back again after {step.seconds:g} s? "
        f"{limits}"
    )


def _speed(velocity: float, override: float, unit: str) -> str:
    """Return the velocity that the axis gets: another program may have set an override."""
    if override == 1.0:
        return f"{velocity:g} {unit}/s"
    return f"{velocity * override:.4g} {unit}/s ({velocity:g} {unit}/s, and an override of {override:g})"


def _require_values(step: TuningStep, override: float, request: AxisCall) -> None:
    seconds = request.positive("seconds", step.seconds, "s")
    if request.finite("size", step.size) == 0.0:
        raise ArgumentError(
            f"{request.text}: a step of 0 is not allowed", remedy="give a distance or a velocity"
        )
    acceleration = request.positive("acceleration", step.acceleration)
    if step.kind is TuningStepKind.VELOCITY:
        request.turning(step.size, acceleration)
    else:
        _require_increments(step, request)
        request.profile(step.velocity, acceleration)
    if seconds > LONGEST:
        raise ArgumentError(
            f"{request.text}: {seconds:g} s for each side is too long", remedy=f"give at most {LONGEST:g} s"
        )
    expected_time = step.expected_time(override)
    min_seconds = expected_time / (1.0 - END)  # otherwise its ramp would count as ripple
    if min_seconds > seconds:
        raise ArgumentError(
            f"{request.text}: the step takes {expected_time:.3g} s, and is recorded for {seconds:g} s",
            remedy=f"give at least {min_seconds:.3g} s for each side, or a smaller step",
        )


def _require_increments(step: TuningStep, request: AxisCall) -> None:
    if not request.distance(step.size):
        raise ArgumentError(
            f"{request.text}: the step is less than one increment of the drive", remedy="give a larger step"
        )


def _require_ready(step: TuningStep, axis: Axis, text: str) -> None:
    if axis.state is not AxisState.STANDSTILL:
        why, remedy = REFUSAL.get(axis.state, _MOVES)
        raise StateError(f"{text}: {axis.name} {why}", remedy=remedy)
    if axis.total_override <= 0.0:
        raise StateError(
            f"{text}: {axis.name} does not move",
            observed="its override is 0",
            remedy="set it to 1 in the program that has changed it",
        )
    if (
        step.kind is TuningStepKind.VELOCITY
        and axis.modes
        and ModeOfOperation.PROFILE_VELOCITY not in axis.modes
    ):
        raise StateError(
            f"{text}: {axis.name} has no velocity mode",
            observed="its drive does not report the profile velocity mode (6502h)",
            remedy="try a step of position",
        )


def _limits(limits: AxisLimits, unit: str, when: str) -> str:
    position = (
        "none"
        if limits.position is None
        else f"from {limits.position[0]:g} to {limits.position[1]:g} {unit}{when}"
    )
    velocity = "none" if limits.velocity is None else f"{limits.velocity:g} {unit}/s"
    acceleration = "none" if limits.acceleration is None else f"{limits.acceleration:g} {unit}/s²"
    return f"position {position}, velocity {velocity}, acceleration {acceleration}"
