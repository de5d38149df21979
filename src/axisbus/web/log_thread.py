"""What the server logs is written by a thread of its own: a terminal that is held up must not hold the pages up."""

from __future__ import annotations

import logging
import queue
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from logging.handlers import QueueHandler, QueueListener

from axisbus.wording import PrintableFormatter

_WAITING = 200  # records; of more the newest are left out


class PageLogThread(QueueHandler):
    """Puts records into a queue, and never waits for room in it."""

    def enqueue(self, record: logging.LogRecord) -> None:
        """Put one in, where there is room."""
        with suppress(queue.Full):
            self.queue.put_nowait(record)


@contextmanager
def logging_aside() -> Iterator[None]:
    """Let a thread write what is logged in the block to standard error."""
    waiting: queue.Queue[logging.LogRecord] = queue.Queue(_WAITING)
    writer, aside, root = logging.StreamHandler(sys.stderr), PageLogThread(waiting), logging.getLogger()
    writer.setFormatter(PrintableFormatter())
    listener = QueueListener(waiting, writer)
    listener.start()
    root.addHandler(aside)
    try:
        yield
    finally:
        root.removeHandler(aside)
        with suppress(
            queue.Full
        ):  # a writer that is held up is left behind: its thread ends with the process
            listener.enqueue_sentinel()
