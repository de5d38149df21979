"""The journal of a core and its watchdog process: a file of limited size for each cell, in the user's state folder.

Theory of operation
-------------------
Log records go into a queue, which a thread writes to the file: a slow disk never delays the scan. If the file cannot be written,
there is no journal.
"""

from __future__ import annotations

import logging
import os
import queue
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from logging.handlers import QueueHandler, QueueListener, RotatingFileHandler
from pathlib import Path

from axisbus.errors import StateError, one_line
from axisbus.wording import PrintableFormatter

_LARGEST = 500_000  # bytes; an older file of the same size is kept
FAULT = ".fault"  # the end of a fault file's name
_FORM = "%(asctime)s %(process)d %(levelname)s %(message)s"


def path_of(cell: str) -> Path:
    """Return the path of a cell file's journal: in ``$XDG_STATE_HOME/axisbus``, else ``~/.local/state/axisbus``.

    Raises:
        StateError: this user has no home, as in some containers.
    """
    given = os.environ.get("XDG_STATE_HOME")
    try:
        home = Path(given) if given else Path.home() / ".local" / "state"
    except RuntimeError as error:  # neither HOME nor an entry in the list of users
        raise StateError(
            "there is no folder for journals and faults",
            observed=str(error),
            remedy="set XDG_STATE_HOME to a folder in which this user may write",
        ) from error
    return home / "axisbus" / f"{Path(cell).stem}-{zlib.crc32(cell.encode()):08x}.log"


def folder_of(cell: str) -> Path:
    """Return the folder of a cell's faults, next to its journal; ``cell``: the path of its file. Raises as ``path_of``."""
    return path_of(cell).with_suffix(".faults")


def faults_of(cell: str) -> list[Path]:
    """Return the stored faults of a cell, oldest first. Raises as ``path_of``."""
    return sorted(folder_of(cell).glob("*" + FAULT))


@contextmanager
def journal(cell: str) -> Iterator[None]:
    """Write the journal of a cell while the block runs: all log records from INFO on."""
    log = logging.getLogger("axisbus")
    try:
        file = _file(path_of(cell))
    except (OSError, StateError) as error:
        log.warning("there is no journal of this core: %s", one_line(error))
        yield
        return
    lines: queue.Queue[logging.LogRecord] = queue.Queue()
    handler, listener = QueueHandler(lines), QueueListener(lines, file)
    log.setLevel(logging.INFO)
    log.addHandler(handler)
    listener.start()
    try:
        yield
    finally:
        log.removeHandler(handler)
        listener.stop()
        with suppress(OSError):  # as in ``_JournalFile``
            file.close()


class _JournalFile(RotatingFileHandler):
    """A file whose lines are lost, without a message for each of them, while its disk is full."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802  # the name in logging
        """Do nothing: the program's log has every warning anyway."""


def _file(path: Path) -> logging.Handler:
    path.parent.mkdir(parents=True, exist_ok=True)
    file = _JournalFile(path, maxBytes=_LARGEST, backupCount=1, encoding="utf-8")
    file.setFormatter(PrintableFormatter(_FORM))
    return file
