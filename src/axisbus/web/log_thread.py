"""Write the server's log in a thread of its own, so that a blocked terminal does not block the pages."""

from __future__ import annotations

import logging
import queue
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from logging.handlers import QueueHandler, QueueListener

from axisbus.wording import PrintableFormatter

_WAITING = 200  # records; when the queue is full, new ones are dropped


class PageLogThread(QueueHandler):
    """Put records into a queue, and never wait for room in it."""

    def enqueue(self, record: logging.LogRecord) -> None:
        """Put a record into the queue if there is room."""
        with suppress(queue.Full):
            self.queue.put_nowait(record)


@contextmanager
def logging_aside() -> Iterator[None]:
    """Log to standard error in a thread of its own within the block."""
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
        with suppress(queue.Full):  # a blocked writer is abandoned: its thread ends with the process
            listener.enqueue_sentinel()
