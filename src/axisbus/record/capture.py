"""A capture: the cycles around a trigger, including those before it."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType

from axisbus.errors import ArgumentError, one_line
from axisbus.motion.numbers import number, short_repr
from axisbus.motion.snapshot import Snapshot
from axisbus.record.condition import Condition
from axisbus.record.events import Watched
from axisbus.record.mcap_writer import library
from axisbus.record.output_file import McapFile, Row
from axisbus.record.triggers import trigger_of

log = logging.getLogger("axisbus")
_LONGEST = 60.0  # seconds, the longest time before and after the trigger
_LATE = 0.5  # seconds within which a core in another process has reported a trigger
_SAME = 1e-6  # seconds
_PATIENCE = 5.0  # seconds for which ``close`` waits for a slow disk


class Capture:
    """One capture of a machine, for a ``with`` block; holds the last cycles until its trigger fires, then the following ones."""

    def __init__(
        self,
        machine: Watched,
        path: Path | str,
        when: str | Condition,
        *,
        before: float,
        after: float,
        axes: Iterable[str] | None = None,
        realtime: bool = True,
    ) -> None:
        """See ``Machine.capture``."""
        for name, seconds in (("before", before), ("after", after)):
            found = number(seconds)
            if found is None or not 0.0 <= found <= _LONGEST:
                raise ArgumentError(f"{name}={short_repr(seconds)}: give seconds from 0 to {_LONGEST:g}")
        self._session = machine.session
        self._target = McapFile(machine, path, axes)
        self._trigger = trigger_of(when, machine, self._target.forms)
        self._condition_text = when if isinstance(when, str) else ""
        self._seconds_before = before
        self._before: deque[Row] = deque(maxlen=int((before + _LATE) / machine.cell.bus.scan_period) + 1)
        self._after: list[Row] = []
        self._seconds_after = after
        self._fired: float | None = None
        self._done = threading.Event()
        self._realtime = realtime
        self._thread: threading.Thread | None = None
        self._claim = threading.Lock()
        self._observing = False
        self.failed = ""  # the reason if there is no file, for display

    def __enter__(self) -> Capture:
        """Begin to observe.

        Raises:
            UserError: the package mcap is not installed.
        """
        library()
        self._observing = True
        self._trigger.begin()
        self._session.observe(self._observe)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop observing; after an error, the stop of the axes can still fire the trigger, until the machine is closed."""
        if error is None or self._session.ended:
            self.close()

    @property
    def path(self) -> Path:
        """The path of the file."""
        return self._target.path

    @property
    def fired(self) -> bool:
        """Whether the trigger has fired."""
        return self._fired is not None

    @property
    def done(self) -> bool:
        """Whether the file is written, or could not be written (``failed``)."""
        return self._done.is_set()

    def wait(self, timeout: float | None = None) -> bool:
        """Block until it is ``done``, at most ``timeout`` seconds; return whether it is."""
        return self._session.waiter.wait(self._done.is_set, timeout)

    def close(self) -> None:
        """Stop observing; if the trigger has fired, write the cycles so far. Harmless when repeated. Blocks for at most 5 s."""
        if self._observing:
            self._observing = False
            self._session.forget(self._observe)
            self._trigger.end()
        if self.fired:
            self._finish()
        if self._thread is not None:
            self._thread.join(_PATIENCE)

    def _observe(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        if self._claim.locked():
            return
        row = self._target.pack(now, snapshots)
        if self._fired is not None:
            self._after.append(row)
            if now - self._fired >= self._seconds_after:
                self._finish()
            return
        self._before.append(row)
        try:
            self._fired = self._trigger.seen(now, snapshots)
        except Exception as error:  # noqa: BLE001  # a user's function must not end the scan
            self._give_up(f"its condition failed: {one_line(error)}")

    def _give_up(self, why: str) -> None:
        self._claim.acquire(blocking=False)
        self.failed = why
        log.warning("the capture %s is given up: %s", self.path, why)
        self._done.set()

    def _finish(self) -> None:
        """Write the file, once: in a thread of its own, or immediately in virtual time."""
        if not self._claim.acquire(blocking=False):
            return
        if self._realtime:
            self._thread = threading.Thread(target=self._write, name="capture", daemon=True)
            self._thread.start()
        else:
            self._write()

    def _since(self) -> list[Row]:
        """Return the wanted cycles before the trigger, which may have been reported late."""
        assert self._fired is not None
        begin, rows = self._fired - self._seconds_before - _SAME, list(self._before)
        late = next((n for n, row in enumerate(rows) if self._target.time_of(row) >= begin), len(rows) - 1)
        return rows[late:]

    def _write(self) -> None:
        rows = [*self._since(), *self._after]
        try:
            self._target.begin(self._target.time_of(rows[0]))
            self._target.write_rows(rows)
            self._target.note(
                f"the moment: {self._condition_text}" if self._condition_text else "the moment", self._fired
            )
            self._target.write_events()
            self._target.close()
        except Exception as error:  # noqa: BLE001  # the motion continues after any error
            self._give_up(one_line(error))
        self._target.abandon()
        self._done.set()
