"""The signals of a scope: the buffer of the last cycles, and how to compute the values of each signal from it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

from axisbus.machine.machine import Machine
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.snapshot import Snapshot
from axisbus.record.columns import COLUMNS, AxisForm
from axisbus.record.sample_packing import sample_of
from axisbus.web.access.limits import MESSAGE, as_object

# -- Buffer the last cycles of a machine for slow pages; the oldest are dropped and counted as lost ------------------------

MAX_CYCLES = 4096  # cycles: 4 s at 1 kHz

Row = tuple[float | str | bool | None, ...]


class ScopeCycle:
    """One cycle: its ``number`` since the first page observes, its time (s) and the process images of its axes; caches its rows."""

    __slots__ = ("_rows", "number", "snapshots", "time")

    def __init__(self, number: int, time: float, snapshots: Mapping[str, Snapshot]) -> None:
        self.number = number
        self.time = time
        self.snapshots = snapshots
        self._rows: dict[str, Row] = {}

    def row(self, axis: str, form: AxisForm) -> Row | None:
        """Return the values of an axis in the order of ``record.columns.COLUMNS``, computed once; for one thread."""
        if axis not in self._rows:
            snapshot = self.snapshots.get(axis)
            if snapshot is None:
                return None
            self._rows[axis] = form.values(sample_of(snapshot))
        return self._rows[axis]


class Fetched(NamedTuple):
    """The cycles since a page's last fetch, how many of them were lost, and the number to continue from."""

    cycles: Sequence[ScopeCycle]
    lost: int
    next: int


class ScopeBuffer:
    """Hold the last cycles; one thread adds, another fetches."""

    def __init__(self, max_cycles: int = MAX_CYCLES) -> None:
        self._cycles: deque[ScopeCycle] = deque(maxlen=max_cycles)
        self.end = 0  # the number of the next cycle

    def add(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        """Store one cycle; for ``Session.observe``."""
        self._cycles.append(ScopeCycle(self.end, now, dict(snapshots)))
        self.end += 1

    def since(self, at: int, max_count: int) -> Fetched:
        """Return at most ``max_count`` cycles, beginning with number ``at``."""
        stored = self._cycles.copy()  # atomic: the other thread may add cycles
        if not stored or stored[-1].number < at:
            return Fetched((), 0, at)
        first = stored[0].number
        begin = max(at, first)
        found = list(islice(stored, begin - first, begin - first + max_count))
        return Fetched(found, begin - at, begin + len(found))


# -- The signals: their names and units, and how to compute their values from an axis's process image ----------------------

NUMBERS = tuple(column for column in COLUMNS if column.type == "number")
_COLUMN_INDEX = {column.name: column_index for column_index, column in enumerate(COLUMNS)}


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
    axes = [axis for axis in machine.axes if axis in facts]
    return [each for axis in axes for each in signals_of(axis, facts[axis].parameters)]


class SignalReader:
    """Read the values of some signals from a cycle; unknown values are NaN."""

    def __init__(self, wanted: Iterable[str], parameters: Mapping[str, AxisParameters]) -> None:
        """``wanted``: signals by name, of axes that ``parameters`` has."""
        self._columns = [
            (axis, _COLUMN_INDEX[column]) for axis, _, column in (name.rpartition(".") for name in wanted)
        ]
        self._forms = {axis: AxisForm.of(parameters[axis]) for axis, _ in self._columns}
        self.count = len(self._columns)

    def values(self, cycle: ScopeCycle) -> list[float]:
        """Return a value for each signal, in their order; NaN if it is unknown, or its axis is absent."""
        rows = {axis: cycle.row(axis, form) for axis, form in self._forms.items()}
        return [_number(rows[axis], column_index) for axis, column_index in self._columns]


def _number(row: Row | None, column_index: int) -> float:
    found = None if row is None else row[column_index]
    return found if isinstance(found, float | int) else math.nan


# -- Parse a page's selection of signals for its scope -----------------------------------------------------------------


MAX_SIGNALS = 10  # signals


@dataclass(frozen=True, slots=True)
class Choice:
    """The selected signals, and the number by which the page recognises the batches of this selection."""

    number: int
    signals: tuple[str, ...]


def read(text: str, known: Collection[str]) -> Choice | None:
    """Return the selection in a message, of the signals in ``known``; None if the message is invalid."""
    found = as_object(text) if len(text) <= MESSAGE else None
    if found is None:
        return None
    number, names = found.get("choice"), found.get("signals")
    if (
        type(number) is not int
        or not 0 <= number < 1 << 32
        or not isinstance(names, list)
        or len(names) > MAX_SIGNALS
    ):
        return None
    if not all(isinstance(name, str) and name in known for name in names):
        return None
    return Choice(number, tuple(dict.fromkeys(names)))
