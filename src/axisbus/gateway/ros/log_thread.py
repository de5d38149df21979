"""Report trajectories to people in a thread of its own, so that a blocked terminal does not delay a halt."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from axisbus.client_support.rate import Bucket
from axisbus.errors import AxisbusError, said_of

_REFUSALS = 2.0  # lines per second at most about refused trajectories
_MOST = 64  # the most waiting lines
_END = 1.0  # seconds for which ``close`` waits for the output


class RosLogThread:
    """Hold the waiting lines; ``tell`` is for any thread."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._bucket = Bucket(_REFUSALS, 2 * _REFUSALS)
        self._waiting: queue.Queue[str | None] = queue.Queue(_MOST)
        self._thread = threading.Thread(target=self._run, name="ROS lines", daemon=True)
        self._thread.start()

    def tell(self, text: str, error: AxisbusError | None) -> None:
        """Report a line; excess lines are dropped. Does not block."""
        if error is not None:
            if not self._bucket.take(time.monotonic()):
                return
            text = f"{text}: {said_of(error)}"
        self._put(f"ROS 2: {text}")

    def close(self) -> None:
        """Write the waiting lines, and end; blocks briefly."""
        self._put(None)
        self._thread.join(_END)

    def _put(self, line: str | None) -> None:
        with suppress(queue.Full):
            self._waiting.put_nowait(line)

    def _run(self) -> None:
        while (line := self._waiting.get()) is not None:
            self._say(line)
