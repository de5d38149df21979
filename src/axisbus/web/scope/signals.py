"""The signals of a scope: their names and units, and how to compute their values from an axis's process image."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.machine.machine import Machine
from axisbus.motion.parameters import AxisParameters
from axisbus.record.columns import COLUMNS, AxisForm
from axisbus.web.access.limits import MESSAGE, as_object
from axisbus.web.scope.cycles import Row, ScopeCycle

NUMBERS = tuple(column for column in COLUMNS if column.type == "number")
_PLACE = {column.name: place for place, column in enumerate(COLUMNS)}


class ScopeSignal(NamedTuple):
    """One signal of one axis: ``name`` such as ``x.position``, the unit, which defines its lane, and its description."""

    name: str
    unit: str
    text: str


def signals_of(axis: str, parameters: AxisParameters) -> list[ScopeSignal]:
    """Return the signals of an axis."""
    form = AxisForm.of(parameters)
    return [ScopeSignal(f"{axis}.{each.name}", form.units[each.quantity], each.text) for each in NUMBERS]


def all_signals(machine: Machine) -> list[ScopeSignal]:
    """Return the signals of every axis that is present."""
    facts = machine.session.axes
    there = [axis for axis in machine.axes if axis in facts]
    return [each for axis in there for each in signals_of(axis, facts[axis].parameters)]


class SignalReader:
    """Read the values of some signals from a cycle; unknown values are NaN."""

    def __init__(self, wanted: Iterable[str], parameters: Mapping[str, AxisParameters]) -> None:
        """``wanted``: signals by name, of axes that ``parameters`` has."""
        self._places = [
            (axis, _PLACE[column]) for axis, _, column in (name.rpartition(".") for name in wanted)
        ]
        self._forms = {axis: AxisForm.of(parameters[axis]) for axis, _ in self._places}
        self.count = len(self._places)

    def values(self, cycle: ScopeCycle) -> list[float]:
        """Return a value for each signal, in their order; NaN if it is unknown, or its axis is absent."""
        rows = {axis: cycle.row(axis, form) for axis, form in self._forms.items()}
        return [_number(rows[axis], place) for axis, place in self._places]


def _number(row: Row | None, place: int) -> float:
    found = None if row is None else row[place]
    return found if isinstance(found, float | int) else math.nan


# -- Parse a page's selection of signals for its scope -----------------------------------------------------------------


MOST = 10  # signals


@dataclass(frozen=True, slots=True)
class Choice:
    """The selected signals, and the number by which the page recognises the batches of this selection."""

    number: int
    signals: tuple[str, ...]


def read(text: str, there: Collection[str]) -> Choice | None:
    """Return the selection in a message, of the signals in ``there``; None if the message is invalid."""
    found = as_object(text) if len(text) <= MESSAGE else None
    if found is None:
        return None
    number, names = found.get("choice"), found.get("signals")
    if (
        type(number) is not int
        or not 0 <= number < 1 << 32
        or not isinstance(names, list)
        or len(names) > MOST
    ):
        return None
    if not all(isinstance(name, str) and name in there for name in names):
        return None
    return Choice(number, tuple(dict.fromkeys(names)))
