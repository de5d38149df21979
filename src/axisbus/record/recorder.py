"""Recording every cycle of a machine's axes, and writing it as CSV."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol

from axisbus.motion.parameters import AxisParameters
from axisbus.motion.snapshot import Snapshot
from axisbus.record.packed import AxisSample, PackedRows
from axisbus.session import AxisSession

COLUMNS = ("position", "velocity", "torque", "target", "state")
LIMIT = 2_000_000  # cycles; the oldest go first


class Open(Protocol):
    """What has a way to a core: a ``Machine``."""

    @property
    def session(self) -> AxisSession:
        """The way to the core that moves all axes."""


class Recorder:
    """Keeps each cycle of the axes in memory while it is attached to a machine; of more than ``LIMIT`` cycles the oldest go.

    In the cycle values are only packed; conversion to units happens when rows are read. Axes of nodes that come later are not
    recorded. Use it as a context manager: ``with Recorder(cell) as recorder:``.
    """

    def __init__(self, machine: Open, every: int = 1) -> None:
        """``machine`` is an open ``Machine``; ``every``: record each n-th cycle."""
        self._session = session = machine.session
        self._parameters: dict[str, AxisParameters] = {
            name: facts.parameters for name, facts in session.axes.items()
        }
        self._every = every
        self._count = 0
        self._cycles = PackedRows(len(self._parameters), LIMIT)

    def __enter__(self) -> Recorder:
        self._session.observe(self._observe)
        return self

    def __exit__(self, *_: object) -> None:
        self._session.forget(self._observe)

    def __len__(self) -> int:
        return len(self._cycles)

    def _observe(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        if self._count % self._every == 0:
            self._cycles.append(now, [snapshots[name] for name in self._parameters])
        self._count += 1

    @property
    def axes(self) -> list[str]:
        """The recorded axes, in order."""
        return list(self._parameters)

    def unit(self, axis: str) -> str:
        """Return the unit of an axis's positions."""
        return self._parameters[axis].units.position.unit

    def header(self) -> list[str]:
        """Return the names of the columns: ``time_s``, then position, velocity, torque, target and state of each axis."""
        return ["time_s", *(f"{axis}.{column}" for axis in self.axes for column in COLUMNS)]

    def rows(self) -> Iterator[list[float | str | None]]:
        """Yield one row per recorded cycle: seconds since the first, then values in units (N·m for torque); None is unknown."""
        begin: float | None = None
        for now, samples in self._cycles:
            begin = now if begin is None else begin
            row: list[float | str | None] = [round(now - begin, 6)]
            for parameters, sample in zip(self._parameters.values(), samples, strict=True):
                row += _values(parameters, sample)
            yield row

    def write_csv(self, path: Path | str) -> Path:
        """Write all rows to ``path`` (an empty field is an unknown value) and return it. The folder is made if needed."""
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(self.header())
            writer.writerows(self.rows())
        return path


def _values(parameters: AxisParameters, sample: AxisSample) -> list[float | str | None]:
    units = parameters.units
    position, velocity = units.position, units.velocity
    return [
        None if sample.position is None else round(position.to_units(sample.position - sample.origin), 6),
        None if sample.velocity is None else round(velocity.to_units(sample.velocity), 6),
        None if sample.torque is None else round(units.torque(sample.torque), 6),
        None if sample.target is None else round(position.to_units(sample.target - sample.origin), 6),
        sample.state.value,
    ]
