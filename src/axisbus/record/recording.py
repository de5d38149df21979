"""A recording under way: the cycles of a machine's axes, and what happens meanwhile, on their way into a file.

Theory of operation
-------------------
In the cycle a row is packed, nothing else. A thread takes the rows, turns them into units and writes them; now and then it asks
the machine what has happened, and reads the objects that were asked for. What that thread cannot do in time is left out, counted
and told, so that memory is bounded; a file that cannot be written ends the recording, and never the motion. In virtual time there
is no thread: whoever lets time pass writes, a second at a time.
"""

from __future__ import annotations

import hashlib
import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import TracebackType

from axisbus.eds.builtin import resolve
from axisbus.errors import AxisbusError, UserError, in_a_line
from axisbus.motion.snapshot import Snapshot
from axisbus.record.columns import NAMES, AxisForm
from axisbus.record.happenings import Happenings, Watched
from axisbus.record.mcap_writer import McapWriter
from axisbus.record.objects import ObjectReads
from axisbus.record.packed import RowForm
from axisbus.record.recorded import Happening

log = logging.getLogger("axisbus")
_ROUND = 0.2  # seconds between two looks at the rows
_LOOK = 1.0  # seconds between two looks at what has happened
_MOST = 15_000  # rows that wait: a minute at 4 ms
_SAMPLE = 220  # bytes of a sample in the file before it is compressed: a chunk is about a second
_ON_THEIR_WAY = 0.2  # seconds that rows may be
_PATIENCE = 5.0  # seconds that the end waits for a slow disk


class Recording:
    """One recording of a machine, for a ``with`` block; holds the rows that wait, and what is written of them."""

    def __init__(
        self,
        machine: Watched,
        path: Path | str,
        *,
        axes: Iterable[str] | None = None,
        objects: Iterable[str] = (),
        realtime: bool = True,
    ) -> None:
        """``machine`` is recorded into ``path``; see ``Machine.recording``."""
        self.path = Path(path)
        self._machine = machine
        self._session = machine.session
        there = self._session.axes
        self._forms = {name: AxisForm(there[name].parameters) for name in _chosen(axes, there, machine)}
        self._objects = ObjectReads(machine, objects)
        self._row = RowForm(len(self._forms))
        self._rows: deque[bytes] = deque()
        self._happenings = Happenings(machine)
        self._realtime = realtime
        self._lost = self._told_lost = 0
        self._rows_written = 0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self._writer: McapWriter | None = None
        self._began = self._newest = self._looked = self._due = self._seen = 0.0
        self._channels: dict[str, int] = {}
        self._object_channels: dict[str, int] = {}
        self._ended = False
        self.failed = ""  # why nothing more is written, for people

    # -- beginning and ending ------------------------------------------------------------------------------------------

    def __enter__(self) -> Recording:
        """Begin.

        Raises:
            UserError: the package mcap is not installed, or the file cannot be written.
        """
        self._began = self._looked = min(
            (s.now for s in self._session.snapshots.values()), default=time.monotonic()
        )
        self._newest = self._began
        try:
            self._begin_file()
        except OSError as error:
            if self._writer is not None:
                self._writer.abandon()
                self._writer = None
            raise UserError(
                f"{self.path} cannot be written", observed=in_a_line(error), remedy="give another path"
            ) from error
        self._session.observe(self._observe)
        if self._realtime:
            self._thread.start()
        return self

    def _begin_file(self) -> None:
        self._writer = writer = McapWriter(self.path, self._facts(), self._began, self._second())
        self._attach(writer)
        self._channels = {name: writer.axis(name, form.schema(name)) for name, form in self._forms.items()}
        self._object_channels = writer.objects(self._objects)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it; after an error the stop of the axes is still in it, and the machine ends it when it is closed."""
        if error is None or self._session.ended:
            self.close()

    def close(self) -> None:
        """Write what waits, and end the file. Harmless when repeated. Blocks, at most 5 s where a disk does not take it."""
        if self._ended or self._writer is None:
            return
        self._ended = True
        self._await_newest()
        self._session.forget(self._observe)
        self._over.set()
        if not self._realtime:
            self._finish()
            return
        self._thread.join(_PATIENCE)
        if self._thread.is_alive():
            log.warning("the recording %s is not written to its end yet: its disk is slow", self.path)

    def _await_newest(self) -> None:
        """Wait until the cycle that the program has seen last is among the rows: they come a few at a time."""
        newest = max((snapshot.now for snapshot in self._session.snapshots.values()), default=0.0)
        until = time.monotonic() + _ON_THEIR_WAY
        while self._realtime and self._seen < newest and time.monotonic() < until:
            time.sleep(0.005)

    # -- how it stands -------------------------------------------------------------------------------------------------

    @property
    def axes(self) -> list[str]:
        """The recorded axes, in order."""
        return list(self._forms)

    @property
    def cycles(self) -> int:
        """How many cycles have been written."""
        return self._rows_written

    @property
    def lost(self) -> int:
        """How many were not, as nobody took them in time."""
        return self._lost

    @property
    def seconds(self) -> float:
        """How long it is."""
        return self._newest - self._began

    @property
    def size(self) -> int:
        """How many bytes are in the file."""
        return 0 if self._writer is None else self._writer.size

    @property
    def reads(self) -> Mapping[str, int]:
        """How often each object has been read."""
        return self._objects.reads

    # -- in the cycle --------------------------------------------------------------------------------------------------

    def _observe(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        self._seen = now
        if len(self._rows) >= _MOST:
            self._lost += 1
            return
        chosen = [snapshots[name] for name in self._forms]
        self._rows.append(self._row.struct.pack(*self._row.values(now, chosen)))
        if not self._realtime and now - self._looked >= _LOOK:
            self._guarded(self._write_all)

    # -- in the recording's thread -------------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._over.wait(self._objects.wait(_ROUND)):
            self._guarded(self._step)
        self._finish()

    def _step(self) -> None:
        assert self._writer is not None
        self._write_object(self._writer)
        now = time.monotonic()
        if now >= self._due:
            self._due = now + _ROUND
            self._write_rows()
        if self._newest - self._looked >= _LOOK:
            self._write_happenings()

    def _write_object(self, writer: McapWriter) -> None:
        read = self._objects.read_next()
        if read is not None:
            label, value = read
            plain = value.hex() if isinstance(value, bytes) else value
            writer.write(self._object_channels[label], time.monotonic(), {"value": plain})

    def _finish(self) -> None:
        assert self._writer is not None
        self._guarded(self._write_all)
        self._guarded(self._writer.close)
        self._writer.abandon()

    def _guarded(self, work: Callable[[], None]) -> None:
        """Do something for the file; where that fails, nothing more is written."""
        if self.failed:
            self._rows.clear()
            return
        try:
            work()
        except Exception as error:  # noqa: BLE001  # whatever it is, the motion goes on
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        if not self.failed:
            self.failed = in_a_line(error)
            log.warning("the recording %s has ended: it cannot be written (%s)", self.path, self.failed)

    def _write_all(self) -> None:
        self._write_rows()
        self._write_happenings()

    def _write_rows(self) -> None:
        assert self._writer is not None
        waiting = [self._rows.popleft() for _ in range(len(self._rows))]
        for now, samples in self._row.rows(b"".join(waiting)):
            for (name, form), sample in zip(self._forms.items(), samples, strict=True):
                values = dict(zip(NAMES, form.values(sample), strict=True))
                self._writer.write(self._channels[name], now, values)
            self._newest = now
            self._rows_written += 1
        if self._lost > self._told_lost:
            text = f"{self._lost - self._told_lost} cycles are missing: they were not taken in time"
            self._told_lost = self._lost
            self._writer.tell(Happening(self._newest, "recording", "", text))

    def _write_happenings(self) -> None:
        assert self._writer is not None
        self._looked = self._newest
        try:
            found = self._happenings.take(self._began)
        except (AxisbusError, ExceptionGroup):  # the core is gone: what it told last is told already
            return
        for happening in found:
            self._writer.tell(happening)

    # -- what is noted beside ------------------------------------------------------------------------------------------

    def _facts(self) -> dict[str, str]:
        cell = self._machine.cell
        real = f"{cell.bus.interface} {cell.bus.channel or ''}".strip()
        return {
            "cell": str(cell.file),
            "scan_period_s": repr(cell.bus.scan_period),
            "drives": "simulated" if self._machine.is_simulated else real,
            "degree": self._machine.degree,
        }

    def _attach(self, writer: McapWriter) -> None:
        cell = self._machine.cell
        writer.attach("cell.toml", "application/toml", cell.source.encode())
        files = {node_id: resolve(node.file or "", cell.folder) for node_id, node in cell.nodes.items()}
        told = {
            str(node_id): {"file": str(file), "sha256": hashlib.sha256(file.read_bytes()).hexdigest()}
            for node_id, file in files.items()
        }
        writer.attach("eds.json", "application/json", json.dumps(told, indent=1).encode())

    def _second(self) -> int:
        """Return about how many bytes a second is, before it is compressed."""
        return max(4096, int(_SAMPLE * max(1, len(self._forms)) / self._machine.cell.bus.scan_period))


def _chosen(axes: Iterable[str] | None, there: Mapping[str, object], machine: Watched) -> list[str]:
    wanted = list(there) if axes is None else list(dict.fromkeys(axes))
    for name in wanted:
        if name not in there:
            raise machine.cell.no_axis(name)
    return wanted
