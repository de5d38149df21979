"""The columns of an axis in a recording: their units, and how to compute them from a sample."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import msgspec

from axisbus.cia402.modes import ModeOfOperation, short
from axisbus.motion.parameters import AxisParameters
from axisbus.record.recording_data import RecordedSeries
from axisbus.record.sample_packing import AxisSample


class Column(NamedTuple):
    """One column: its quantity (which defines its unit), its JSON type, and its description."""

    name: str
    quantity: str
    type: str
    text: str


COLUMNS = (
    Column("position", "position", "number", "actual position, counted from the axis's zero"),
    Column("velocity", "velocity", "number", "actual velocity"),
    Column("torque", "torque", "number", "actual torque"),
    Column("target", "position", "number", "the position that the master commands, in whatever mode it does"),
    Column("demand", "position", "number", "the position that the drive's own trajectory demands (6062h)"),
    Column(
        "following_error", "position", "number", "demand, or target of a cyclic position mode, minus position"
    ),
    Column("state", "", "string", "state of the axis, by PLCopen"),
    Column("power", "", "string", "state of the power stage (CiA 402)"),
    Column("mode", "", "string", "mode of operation that the drive shows (6061h)"),
    Column("statusword", "", "integer", "statusword (6041h)"),
    Column("homed", "", "boolean", "whether the zero of the axis is known"),
)
NAMES = tuple(column.name for column in COLUMNS)
# Twice as fast to encode as a dict; unknown values are omitted, as the schema of the channel requires.
SampleRow = msgspec.defstruct("SampleRow", [(name, Any, None) for name in NAMES], omit_defaults=True)
# In these modes the drive follows the target of each cycle; mode numbers of CiA 402, as in samples.
_CYCLIC_POSITION_MODES = frozenset(
    {int(ModeOfOperation.CYCLIC_SYNC_POSITION), int(ModeOfOperation.INTERPOLATED_POSITION)}
)
_OF_RATED = "of rated torque"


@dataclass(frozen=True, slots=True)
class AxisForm:
    """Convert the samples of one axis to the values of ``COLUMNS``: in its units, with the decimals that its increments resolve.

    ``position`` and ``velocity``: increments per unit; ``torque``: one per mille in the unit of torques.
    """

    position: float
    velocity: float
    torque: float
    units: Mapping[str, str]  # by quantity
    _digits: tuple[int, int, int] = field(init=False, repr=False, compare=False)  # of the three above

    def __post_init__(self) -> None:
        """Compute once what each conversion needs."""
        decimals = digits(self.position), digits(self.velocity), digits(1.0 / self.torque)
        object.__setattr__(self, "_digits", decimals)

    @classmethod
    def of(cls, parameters: AxisParameters) -> AxisForm:
        """Return the form of an axis."""
        units = parameters.units
        names = {
            "position": units.position.unit,
            "velocity": units.velocity.unit,
            "torque": _OF_RATED if units.rated_torque is None else "N·m",
            "": "",
        }
        return cls(units.position.factor, units.velocity.factor, units.torque(1), names)

    def unit(self, column: str) -> str:
        """Return the unit of a column, empty if it has none."""
        return self.units[next(each.quantity for each in COLUMNS if each.name == column)]

    def values(self, sample: AxisSample) -> tuple[float | str | bool | None, ...]:
        """Return a sample in units, in the order of ``COLUMNS``; None is unknown."""
        position, velocity, torque, target, demand, origin, mode, word, state, power, homed = sample
        factor = self.position
        fine, of_velocity, of_torque = self._digits
        reference = demand if demand is not None else target if mode in _CYCLIC_POSITION_MODES else None
        return (
            None if position is None else round((position - origin) / factor, fine),
            None if velocity is None else round(velocity / self.velocity, of_velocity),
            None if torque is None else round(torque * self.torque, of_torque),
            None if target is None else round((target - origin) / factor, fine),
            None if demand is None else round((demand - origin) / factor, fine),
            None if reference is None or position is None else round((reference - position) / factor, fine),
            state.value,
            power.value,
            None if mode is None else _short(mode),
            word,
            homed,
        )

    def schema(self, axis: str) -> dict[str, Any]:
        """Return the JSON schema of a sample of this axis, with the unit of each value; unknown values are omitted."""
        return {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": f"axis {axis}",
            "type": "object",
            "properties": {column.name: _property(column, self.units[column.quantity]) for column in COLUMNS},
        }


def _property(column: Column, unit: str) -> dict[str, Any]:
    return {"type": column.type, "description": column.text, **({"unit": unit} if unit else {})}


@cache
def _short(mode: int) -> str:
    return short(ModeOfOperation(mode))


def track_of(name: str, form: AxisForm, times: list[float], rows: Iterable[Sequence[Any]]) -> RecordedSeries:
    """Return the series of an axis from its values in the order of ``COLUMNS``; None is unknown."""
    columns = list(zip(*rows, strict=True)) or [()] * len(COLUMNS)
    known = {
        column.name: [math.nan if value is None else value for value in values]
        if column.type == "number"
        else values
        for column, values in zip(COLUMNS, columns, strict=True)
    }
    return RecordedSeries(
        name, times, known, {column.name: form.units[column.quantity] for column in COLUMNS}
    )


def tracks_of(
    forms: Mapping[str, AxisForm], times: list[float], cycles: Iterable[tuple[float, Sequence[AxisSample]]]
) -> dict[str, RecordedSeries]:
    """Return the series of each axis; each cycle has the samples of all axes, in the order of ``forms``."""
    rows = [samples for _, samples in cycles]
    return {
        name: track_of(name, form, times, [form.values(samples[number]) for samples in rows])
        for number, (name, form) in enumerate(forms.items())
    }


@cache
def digits(increments: float) -> int:
    """Return the number of decimals that resolve one increment, given the number of increments per unit."""
    return max(0, math.ceil(math.log10(abs(increments))) + 1)
