"""Compare the scales of cell.toml with those that a drive's objects suggest; a suggestion is never used automatically."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from axisbus.cell.model import INCREMENTS, AxisConfig
from axisbus.cell.quantities import units_of
from axisbus.cia402 import objects as o
from axisbus.cia402.si_units import INCREMENT, TURN, IncrementSize, by_dimension, decoded
from axisbus.motion.parameters import AxisLimits
from axisbus.units import TURNS, Scale

_TOLERANCE = 1e-3
_ONE = (Fraction(1),)
_ROUNDED = 0.01  # allowed deviation of velocity_scale and acceleration_scale: they are often rounded

OBJECTS = (
    (o.ENCODER_RESOLUTION, 1),
    (o.ENCODER_RESOLUTION, 2),
    (o.GEAR_RATIO, 1),
    (o.GEAR_RATIO, 2),
    (o.FEED_CONSTANT, 1),
    (o.FEED_CONSTANT, 2),
    (o.SI_UNIT_POSITION, 0),
    (o.SI_UNIT_VELOCITY, 0),
    (o.SI_UNIT_ACCELERATION, 0),
    (o.VELOCITY_NOTATION, 0),
    (o.VELOCITY_DIMENSION, 0),
    (o.ACCELERATION_NOTATION, 0),
    (o.ACCELERATION_DIMENSION, 0),
)

Values = Mapping[tuple[int, int], int | None]


@dataclass(frozen=True, slots=True)
class ScaleReport:
    """The configured scale (or rated torque) and the one that the drive's objects suggest; ``agrees`` None: no suggestion."""

    configured: str
    proposed: str
    agrees: bool | None


def compare(scale: Scale, values: Values) -> ScaleReport:
    """Compare a configured position scale with the suggestion of 608Fh, 6091h and 6092h.

    The objects do not say on which side of the gear 6064h counts, so each side is a candidate.
    """
    configured = f"{abs(scale.factor):g} increments per {scale.unit}"
    found = candidates(scale.unit, values)
    if not found:
        return ScaleReport(configured, _nothing(scale.unit, values), None)
    for side, proposed in found:
        if abs(abs(scale.factor) - float(proposed)) <= _TOLERANCE * float(proposed):
            return ScaleReport(configured, f"agrees with the drive's objects ({side})", agrees=True)
    texts = ", ".join(f"{float(proposed):g} ({side})" for side, proposed in found)
    return ScaleReport(configured, f"the drive's objects suggest {texts}", agrees=False)


def candidates(unit: str, values: Values) -> list[tuple[str, Fraction]]:
    """Return the position scales that 608Fh and 6091h suggest, in increments per unit, each with its side of the gear."""
    part = TURNS.get(unit.lower())
    motor = _ratio(values, o.ENCODER_RESOLUTION)
    if part is None or motor is None:
        return []
    gear = _ratio(values, o.GEAR_RATIO)
    found = [("at the motor", motor * part)]
    if gear is not None and gear != 1:
        found.insert(0, ("at the gear's output", motor * gear * part))
    return found


@dataclass(frozen=True, slots=True)
class Rate:
    """The size of one velocity (or acceleration) increment by a drive's objects.

    ``ratios``: its size in position increments per s (or s²), one for each possible side of the gear; empty: unknown.
    ``is_certain``: the ratios follow from the units alone, and not from 608Fh or 6091h. ``needs_turn``: the unit is turns, and
    608Fh does not say how many increments a turn has.
    """

    key: str
    source: str
    text: str
    size: Fraction
    ratios: tuple[Fraction, ...]
    is_certain: bool
    needs_turn: bool


@dataclass(frozen=True, slots=True)
class ScaleContradiction:
    """A scale of the cell file that the drive's objects contradict; ``is_certain``: it does not depend on 608Fh and the gear."""

    key: str
    message: str
    observed: str
    remedy: str
    is_certain: bool


def rates(values: Values) -> tuple[Rate, ...]:
    """Return the increments of velocity and acceleration by the drive's objects; empty if the objects have no information."""
    position = decoded(values.get((o.SI_UNIT_POSITION, 0))) or IncrementSize(INCREMENT, Fraction(1), "inc")
    velocity = decoded(values.get((o.SI_UNIT_VELOCITY, 0)))
    acceleration = decoded(values.get((o.SI_UNIT_ACCELERATION, 0)))
    old_velocity = by_dimension(values.get((o.VELOCITY_NOTATION, 0)), values.get((o.VELOCITY_DIMENSION, 0)))
    old = by_dimension(values.get((o.ACCELERATION_NOTATION, 0)), values.get((o.ACCELERATION_DIMENSION, 0)))
    old_acceleration = None if old is None else old._replace(text=f"{old.text}/s")
    found = (
        ("velocity_scale", "60A9h", velocity, "608Ch", old_velocity),
        ("acceleration_scale", "60AAh", acceleration, "608Eh", old_acceleration),
    )
    made = []
    for key, source, count, old_source, old_count in found:
        count, source = (count, source) if count is not None else (old_count, old_source)
        if count is not None:
            made.append(_rate(key, source, count, position, values))
    return tuple(made)


def _rate(key: str, source: str, count: IncrementSize, position: IncrementSize, values: Values) -> Rate:
    gear = _ratio(values, o.GEAR_RATIO) or Fraction(1)
    sides = sorted({Fraction(1), gear, 1 / gear})
    if count.what == position.what:
        by_gear = sides if count.what == TURN else [Fraction(1)]
        ratios = tuple(count.size / position.size * side for side in by_gear)
        return Rate(key, source, count.text, count.size, ratios, len(ratios) == 1, needs_turn=False)
    turn = _turn(values)
    if {count.what, position.what} != {TURN, INCREMENT} or turn is None:
        return Rate(key, source, count.text, count.size, (), is_certain=False, needs_turn=count.what == TURN)
    one = count.size * turn / position.size if count.what == TURN else count.size / (turn * position.size)
    ratios = tuple(one * side for side in sides)
    return Rate(key, source, count.text, count.size, ratios, is_certain=False, needs_turn=False)


def _turn(values: Values) -> Fraction | None:
    """Return the increments of a motor turn by 608Fh; None for 1 increment per turn, which is no information."""
    turn = _ratio(values, o.ENCODER_RESOLUTION)
    return None if turn == 1 else turn


def counts_increments(axis: AxisConfig, values: Values) -> bool:
    """Whether the drive's velocities are certainly in position increments per s, and its accelerations are not known to differ."""
    known = {rate.key: rate.ratios == _ONE and rate.is_certain for rate in rates(values)}
    counted = known.get("velocity_scale", False)
    return counted and (axis.acceleration_scale is not None or known.get("acceleration_scale", True))


def contradictions(axis: AxisConfig, values: Values) -> list[ScaleContradiction]:
    """Return the contradictions of ``velocity_scale`` and ``acceleration_scale``, or of their defaults, to the drive's units.

    An axis in increments without ``velocity_scale`` uses the drive's own increments, and has no contradiction.
    """
    if axis.virtual or (axis.unit == INCREMENTS and axis.velocity_scale is None):
        return []
    units, found = units_of(axis), {rate.key: rate for rate in rates(values)}
    configured = {
        "velocity_scale": (units.velocity, axis.velocity_scale),
        "acceleration_scale": (units.acceleration, axis.acceleration_scale),
    }
    made = []
    for key, rate in found.items():
        scale, given = configured[key]
        if not _agrees(abs(units.position.exact / scale.exact), rate, given=given is not None):
            made.append(_contradiction(axis, rate, units.position, scale, given=given is not None))
    speed = found.get("velocity_scale")
    left_out = axis.acceleration_scale is None and "acceleration_scale" not in found
    if speed is not None and left_out and speed.ratios != _ONE:
        made.append(_missing_acceleration(axis, speed))
    return made


def _agrees(ratio: Fraction, rate: Rate, *, given: bool) -> bool:
    if not rate.ratios:
        return given  # the default of a key that is left out is another unit
    return any(abs(ratio - one) <= _ROUNDED * one for one in rate.ratios)


def _contradiction(
    axis: AxisConfig, rate: Rate, position: Scale, scale: Scale, *, given: bool
) -> ScaleContradiction:
    per = scale.unit
    is_ = f"{rate.key} is {abs(scale.factor):g} increments per {per}" + ("" if given else " (left out)")
    if rate.ratios:
        texts = dict.fromkeys(f"{abs(position.factor) / float(one):.6g}" for one in rate.ratios)
        remedy = f"write {rate.key} = {' or '.join(texts)} in [axes.{axis.name}]"
    elif rate.needs_turn:
        above = f"{abs(position.factor) / float(rate.size):g}"
        remedy = (
            f"write {rate.key} = {above} / N in [axes.{axis.name}], N being the position increments of one turn of the motor "
            "(its encoder, in quadrature)"
        )
    else:
        remedy = f"write {rate.key} in [axes.{axis.name}]: increments of {rate.text} per {per}"
    return ScaleContradiction(
        rate.key,
        f"axis {axis.name}: {rate.key} does not match the unit of its drive",
        f"{is_}; the unit of the drive is {rate.text} ({rate.source})",
        f"{remedy}, or set another unit in the drive ({rate.source})",
        rate.is_certain or not given,
    )


def _missing_acceleration(axis: AxisConfig, speed: Rate) -> ScaleContradiction:
    return ScaleContradiction(
        "acceleration_scale",
        f"axis {axis.name}: acceleration_scale is missing",
        f"the drive's unit of velocity is {speed.text} ({speed.source}), and its unit of acceleration is not given",
        f"write acceleration_scale in [axes.{axis.name}] by the drive's manual: for ({speed.text})/s it is velocity_scale",
        is_certain=True,
    )


def _nothing(unit: str, values: Values) -> str:
    motor = _ratio(values, o.ENCODER_RESOLUTION)
    if motor is None:
        return "the drive's objects suggest nothing (608Fh is missing or 0): check it by a small move"
    return f"608Fh says {float(motor):g} increments per motor turn; how many {unit} that is depends on the machine"


def _ratio(values: Values, index: int) -> Fraction | None:
    above, below = values.get((index, 1)), values.get((index, 2))
    return None if not above or not below else Fraction(above, below)


# -- The torque of a drive by its objects: the rated torque compared with cell.toml, and the highest allowed torque --------

_MILLI = 1000  # 6076h is in mN·m, 6072h in 0.1 % of rated torque (CiA 402-2 16.4)
_TORQUE_TOLERANCE = 0.01

Read = Callable[[int], int | None]


def compare_torque(rated: float | None, drive: int | None) -> ScaleReport | None:
    """Compare ``rated_torque`` (N·m, with or without a sign) with 6076h; None if the cell file does not give it.

    Torques are sent as parts of the rated torque: if the two differ, the motor's torque differs from the commanded torque.
    """
    if rated is None:
        return None
    configured = f"{abs(rated):g} N·m"
    if not drive:
        return ScaleReport(configured, "the drive's objects suggest nothing (6076h is missing or 0)", None)
    agrees = abs(abs(rated) - drive / _MILLI) <= _TORQUE_TOLERANCE * abs(rated)
    if agrees:
        return ScaleReport(configured, "agrees with the drive's object (6076h)", agrees)
    ratio = drive / _MILLI / abs(rated)
    text = f"6076h has {drive / _MILLI:g} N·m: if it is right, the motor gives {ratio:.3g} times the commanded torque"
    return ScaleReport(configured, text, agrees)


def limited_torque(limits: AxisLimits, rated: float | None, read: Read) -> AxisLimits:
    """Return ``limits`` with the drive's own highest torque (6072h) if the cell file gives none; ``rated`` in N·m."""
    most = read(o.MAX_TORQUE)
    if limits.torque is not None or rated is None or not most:
        return limits
    return replace(limits, torque=most / _MILLI * abs(rated), torque_key="the drive's 6072h")
