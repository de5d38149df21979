"""Record every cycle of a machine's axes in memory, for a program that evaluates them immediately."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol

from axisbus.motion.snapshot import Snapshot
from axisbus.record.columns import NAMES, AxisForm, tracks_of
from axisbus.record.export import write_csv
from axisbus.record.recording_data import Recorded
from axisbus.record.sample_packing import PackedRows
from axisbus.session import AxisSession

LIMIT = 2_000_000  # cycles; the oldest are dropped first


class SessionOwner(Protocol):
    """An object with a session with a core: a ``Machine``."""

    @property
    def session(self) -> AxisSession:
        """The session with the core that moves all axes."""


class Recorder:
    """Hold each cycle of the axes in memory while attached to a machine; beyond ``LIMIT`` cycles the oldest are dropped.

    In the cycle, values are only packed; they are converted to units when rows are read. Axes of nodes that join later are not
    recorded. Use it as a context manager: ``with Recorder(cell) as recorder:``. ``Machine.recording`` instead writes a file while
    recording.
    """

    def __init__(self, machine: SessionOwner, every: int = 1) -> None:
        """``machine`` is an open ``Machine``; ``every``: record each n-th cycle."""
        self._session = session = machine.session
        self._forms = {name: AxisForm.of(facts.parameters) for name, facts in session.axes.items()}
        self._every = every
        self._count = 0
        self._cycles = PackedRows(len(self._forms), LIMIT)

    def __enter__(self) -> Recorder:
        self._session.observe(self._observe)
        return self

    def __exit__(self, *_: object) -> None:
        self._session.forget(self._observe)

    def __len__(self) -> int:
        return len(self._cycles)

    def _observe(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        if self._count % self._every == 0:
            self._cycles.append(now, [snapshots[name] for name in self._forms])
        self._count += 1

    @property
    def axes(self) -> list[str]:
        """The recorded axes, in order."""
        return list(self._forms)

    def unit(self, axis: str) -> str:
        """Return the unit of an axis's positions."""
        return self._forms[axis].unit("position")

    def header(self) -> list[str]:
        """Return the names of the columns of ``rows``: ``time``, then those of each axis, such as ``x.position``."""
        return ["time", *(f"{axis}.{column}" for axis in self.axes for column in NAMES)]

    def rows(self) -> Iterator[list[float | str | bool | None]]:
        """Yield one row per recorded cycle: seconds since the first, then values in units (N·m for torque); None is unknown."""
        begin: float | None = None
        for now, samples in self._cycles:
            begin = now if begin is None else begin
            row: list[float | str | bool | None] = [round(now - begin, 6)]
            for form, sample in zip(self._forms.values(), samples, strict=True):
                row += form.values(sample)
            yield row

    def recorded(self) -> Recorded:
        """Return the cycles recorded so far, in the form of a recording read from a file."""
        cycles = list(self._cycles)
        times = [round(now - cycles[0][0], 6) for now, _ in cycles]
        return Recorded(tracks_of(self._forms, times, cycles))

    def write_csv(self, path: Path | str) -> Path:
        """Write all rows to ``path`` and return it; the header has units, an empty field is an unknown value. Makes the folder.

        Raises:
            UserError: nothing was recorded.
        """
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_csv(self.recorded(), path)
        return path
