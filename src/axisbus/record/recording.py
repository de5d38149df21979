"""Record the cycles of a machine's axes, and its events, to a file.

Theory of operation
-------------------
The cycle only packs a row, unless a core has already packed it. A thread takes the rows, converts them to units and writes them;
periodically it asks the machine for events, and reads the requested objects. Rows that this thread cannot process in time are
dropped, counted and reported, so that memory is bounded. If the file cannot be written, the recording ends, but never the motion.
In virtual time it is a thread of the machine's clock.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import TracebackType

from axisbus.clock import REAL, Clock
from axisbus.errors import one_line
from axisbus.motion.snapshot import Snapshot
from axisbus.record.events import Watched
from axisbus.record.mcap_writer import ObjectDescription
from axisbus.record.objects import (
    MappedObjects,
    MappedSignal,
    ObjectReads,
    WantedObject,
    mapped_signal,
    wanted_object,
)
from axisbus.record.output_file import McapFile, Row, texts_of
from axisbus.wording import counted

log = logging.getLogger("axisbus")
_ROUND = 0.5  # seconds between two checks for rows
_EVENT_PERIOD = 1.0  # seconds between two checks for events
_MOST = 15_000  # the most waiting rows: a minute at 4 ms
_ARRIVAL_TIME = 0.2  # seconds that the transmission of rows may take
_PATIENCE = 5.0  # seconds for which ``close`` waits for a slow disk


class Recording:
    """One recording of a machine, for a ``with`` block; holds the waiting rows, and the progress of writing."""

    def __init__(
        self,
        machine: Watched,
        path: Path | str,
        *,
        axes: Iterable[str] | None = None,
        objects: Iterable[str] = (),
        clock: Clock = REAL,
    ) -> None:
        """Record ``machine`` to ``path``; see ``Machine.recording``. ``clock`` is that of the machine."""
        self._session = machine.session
        self._period = machine.cell.bus.scan_period
        self._target = McapFile(machine, path, axes)
        wanted = [wanted_object(machine, text) for text in texts_of("objects", objects)]
        has_frames = self._session.carried is not None
        self._mapped = MappedObjects(
            self._session, (lambda: _mapped_signals(machine, wanted)) if has_frames else list
        )
        carried = {signal.label: signal.carried.pdo for signal in self._mapped.signals}
        self._objects = ObjectReads(machine, [one for one in wanted if one.label not in carried], clock)
        self._descriptions = {
            one.label: ObjectDescription(
                one.name,
                carried.get(one.label, "by SDO, in turn"),
                one.json_type(carried=one.label in carried),
            )
            for one in wanted
        }
        self._rows: deque[Row] = deque()
        self._clock = clock
        self._lost = self._reported_lost = 0
        self._over = clock.event()
        self._thread = clock.thread(self._run, "recording")
        self._last_events = self._due = self._seen = 0.0
        self._ended = False
        self.failed = ""  # why writing has ended, for people

    # -- beginning and ending ------------------------------------------------------------------------------------------

    def __enter__(self) -> Recording:
        """Start recording.

        Raises:
            UserError: the package mcap is not installed, or the file cannot be written.
        """
        snapshots = self._session.snapshots.values()
        self._last_events = max((snapshot.now for snapshot in snapshots), default=self._clock.now())
        self._target.begin(self._last_events, self._descriptions)
        self._session.observe(self._observe)
        self._mapped.begin()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the recording; after an error, it continues during the stop of the axes, and ends when the machine is closed."""
        if error is None or self._session.ended:
            self.close()

    def close(self) -> None:
        """Write the waiting rows, and close the file. Harmless when repeated. Blocks, for at most 5 s if the disk is slow."""
        if self._ended or not self._target.is_open:
            return
        self._ended = True
        self._await_newest()
        self._session.forget(self._observe)
        self._mapped.end()
        self._over.set()
        self._thread.join(_PATIENCE)
        if self._thread.is_alive():
            log.warning("the recording %s is not written to its end yet: its disk is slow", self.path)

    def _await_newest(self) -> None:
        """Wait for the row of the newest cycle that the program has seen: rows arrive in groups."""
        newest = max((snapshot.now for snapshot in self._session.snapshots.values()), default=0.0)
        until = self._clock.now() + _ARRIVAL_TIME
        while self._clock.realtime and self._seen < newest and self._clock.now() < until:
            self._clock.sleep(0.005)

    # -- progress ------------------------------------------------------------------------------------------------------

    @property
    def path(self) -> Path:
        """The path of the file."""
        return self._target.path

    @property
    def axes(self) -> list[str]:
        """The recorded axes, in order."""
        return list(self._target.forms)

    @property
    def cycles(self) -> int:
        """The number of written cycles."""
        return self._target.rows

    @property
    def lost(self) -> int:
        """The number of cycles dropped because they were not processed in time."""
        return self._lost

    @property
    def seconds(self) -> float:
        """The duration of the recording."""
        return self._target.newest - self._target.began

    @property
    def size(self) -> int:
        """The number of bytes in the file."""
        return self._target.size

    @property
    def reads(self) -> Mapping[str, int]:
        """How often each object has been read, or received in a PDO."""
        return {**self._objects.reads, **self._mapped.counts}

    # -- in the cycle --------------------------------------------------------------------------------------------------

    def _observe(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        self._seen = now
        if len(self._rows) >= _MOST:
            self._lost += 1
            return
        self._rows.append(self._target.pack(now, snapshots))

    # -- in the recording's thread -------------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._over.wait(self._objects.wait(_ROUND)):
            self._guarded(self._step)
        self._finish()

    def _step(self) -> None:
        read = self._objects.read_next()
        now = self._clock.now()
        if read is not None:
            label, value = read
            self._target.write_object(label, now, value)
        if now >= self._due:
            self._due = now + _ROUND
            self._write_rows(now)
        if self._target.newest - self._last_events >= _EVENT_PERIOD:
            self._write_events()

    def _finish(self) -> None:
        self._guarded(self._write_all)
        self._guarded(self._target.close)
        self._target.abandon()

    def _guarded(self, work: Callable[[], None]) -> None:
        """Run work on the file; if it fails, end the writing."""
        if self.failed:
            self._rows.clear()
            return
        try:
            work()
        except Exception as error:  # noqa: BLE001  # the motion continues after any error
            self.failed = one_line(error)
            log.warning("the recording %s has ended: it cannot be written (%s)", self.path, self.failed)

    def _write_all(self) -> None:
        self._write_rows(math.inf)
        self._write_events()

    def _write_rows(self, until: float) -> None:
        self._target.write_rows([self._rows.popleft() for _ in range(len(self._rows))])
        for label in self._mapped.locate_again():
            self._target.note(f"{label}: its node was booted again, and maps it to another place")
        self._mapped.write(self._target.write_object, until)
        if self._lost > self._reported_lost:
            lost = counted(self._lost - self._reported_lost, "cycle is missing", "cycles are missing")
            self._target.note(f"{lost}: not read in time")
            self._reported_lost = self._lost

    def _write_events(self) -> None:
        self._last_events = self._target.newest
        self._target.write_events()


def _mapped_signals(machine: Watched, wanted: Iterable[WantedObject]) -> list[MappedSignal]:
    """Return the locations of the objects that PDOs carry."""
    found = [mapped_signal(machine, one) for one in wanted]
    return [signal for signal in found if signal is not None]
