"""Whether the motion of an axis leaves room for a superimposed motion: of acceleration once, of position in each cycle."""

from __future__ import annotations

from axisbus.errors import LimitError
from axisbus.motion.moves.lookahead import LookaheadTrajectory
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_limit_check import PathLimitCheck, Ramped
from axisbus.motion.position_limits import Room
from axisbus.motion.superimposed.addition import Addition
from axisbus.motion.trajectory import Trajectory

_LEAST = 0.02  # of max_acceleration: with less it would take too long
_LATE = 2.0  # cycles: a finding of this cycle takes effect in the next one


def admit(
    addition: Addition, path: Trajectory, shifted: float, parameters: AxisParameters, room: Room | None
) -> None:
    """Limit the addition's ramps to the acceleration that ``path``, which is already shifted by ``shifted`` (units), leaves.

    ``room``: the permitted range of the axis; without position limits, the range of its drive's count.

    Raises:
        LimitError: the path leaves too little acceleration, or the sum is known to leave the position limits or the drive's count.
    """
    name, unit = parameters.name, parameters.units.position.unit
    limit = parameters.limits.acceleration
    if limit is not None and isinstance(path, Ramped):
        left = limit - path.top_acceleration
        if left < _LEAST * limit:
            raise LimitError(
                f"{name}: its present motion needs all of max_acceleration, so no distance can be superimposed",
                observed=f"it needs {path.top_acceleration:g} {unit}/s², allowed are {limit:g}",
                remedy=f"give the present motion of {name} less acceleration, or raise max_acceleration in [axes.{name}] of "
                "cell.toml",
            )
        addition.soften(left)
    limits = parameters.limits.position or room
    if limits is None or not isinstance(path, LookaheadTrajectory):
        return
    low, high = (edge + shifted for edge in path.span)
    reach = addition.distance + low if addition.distance < 0.0 else addition.distance + high
    margin = abs(parameters.units.position.to_units(1))
    if not limits[0] - margin <= reach <= limits[1] + margin:
        raise LimitError(
            f"{name}: its present motion with the superimposed distance would leave "
            + (
                "the drive's position range (INTEGER32)"
                if parameters.limits.position is None
                else "the position limits"
            ),
            observed=f"the present motion is from {low:g} to {high:g} {unit}, the sum reaches {reach:g}; allowed are "
            f"{limits[0]:g} to {limits[1]:g}",
            remedy=f"superimpose a shorter distance, or change position_limits in [axes.{name}] of cell.toml",
        )


def look_ahead(
    addition: Addition,
    here: float,
    velocity: float,
    pace: PathLimitCheck,
    limits: tuple[float, float],
    parameters: AxisParameters,
) -> LimitError | None:
    """Return why a superimposed motion must brake now: otherwise the axis, which moves from ``here``, could not be stopped in time.

    ``velocity``: velocity of the path. Only the direction of the superimposed motion is checked.
    """
    deceleration = parameters.path_deceleration
    if not deceleration:
        return None
    rest = here + addition.rest(velocity, deceleration, _LATE * pace.period)
    if not (addition.rate > 0.0 and rest > limits[1]) and not (addition.rate < 0.0 and rest < limits[0]):
        return None
    name, unit = parameters.name, parameters.units.position.unit
    return LimitError(
        f"{name}: a superimposed distance takes it to its position limits",
        observed=f"{addition.value:g} of {addition.distance:g} {unit} are done; it would stop at {rest:g} {unit}, allowed "
        f"are {limits[0]:g} to {limits[1]:g}",
        remedy=f"superimpose a shorter distance, or change position_limits in [axes.{name}] of cell.toml; the superimposed "
        "motion was braked, and the motion under it continues",
    )
