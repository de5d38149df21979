"""Recordings for a fleet: one query after the other, each in a process of its own."""

from __future__ import annotations

import logging
import queue
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import msgspec

from axisbus.errors import AxisbusError, StateError
from axisbus.fleet.messages import HistoryAnswer, HistoryAsk
from axisbus.ipc.errors import to_fields

log = logging.getLogger("axisbus")
_WAITING = 8
_LONGEST = 120.0  # seconds that a query may take
Reply = Callable[[HistoryAnswer], None]


class RecordingsWorker:
    """Hold the waiting queries, and the running process; ``put`` is for any thread."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._work: queue.Queue[tuple[HistoryAsk, Reply] | None] = queue.Queue(_WAITING)
        self._reading: subprocess.Popen[bytes] | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="history", daemon=True)
        self._thread.start()

    def put(self, request: HistoryAsk, reply: Reply) -> None:
        """Queue a query and answer it; refused if too many are waiting. Does not block."""
        try:
            self._work.put_nowait((request, reply))
        except queue.Full:
            reply(
                refused(StateError("too many queries about recordings are waiting", remedy="try again later"))
            )

    def close(self) -> None:
        """End, and kill the running process; blocks briefly."""
        self._closing = True
        while not self._work.empty():
            self._work.get_nowait()
        self._work.put(None)
        if (reading := self._reading) is not None:
            reading.kill()
        self._thread.join()

    def _run(self) -> None:
        while (each := self._work.get()) is not None and not self._closing:
            request, reply = each
            try:
                answer = self._answer(request)
            except Exception as error:
                log.exception("recordings could not be read")
                answer = refused(AxisbusError("the recordings could not be read", observed=str(error)))
            reply(answer)

    def _answer(self, request: HistoryAsk) -> HistoryAnswer:
        if self._folder is None:
            return refused(
                StateError(
                    "this cell does not publish recordings",
                    remedy="start its bridge with --recordings FOLDER",
                )
            )
        command = [sys.executable, "-m", "axisbus.gateway.zenoh.recordings_worker", str(self._folder)]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        ) as reading:  # Ctrl-C in the terminal must only end the bridge
            self._reading = reading
            try:
                output, _ = reading.communicate(msgspec.json.encode(request), _LONGEST)
            except subprocess.TimeoutExpired:
                return refused(StateError(f"reading took longer than {_LONGEST:g} s, and was aborted"))
            finally:
                reading.kill()
                self._reading = None
        return msgspec.json.decode(output, type=HistoryAnswer)


def refused(error: AxisbusError) -> HistoryAnswer:
    """Return the answer that reports an error."""
    return HistoryAnswer(error=to_fields(error))
