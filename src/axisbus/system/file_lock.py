"""A lock file: the system releases the lock when the process that holds it ends, however it ends."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Self

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_NO_LINK: int = getattr(os, "O_NOFOLLOW", 0)  # another user may write the folder too
_LOCKED = 1 << 30  # the byte that is locked: beyond the text, which others must be able to read


class FileLock:
    """Holds a lock file open until it is closed. The file stays: if it were deleted, two processes could lock two of that name."""

    def __init__(self, file: int) -> None:
        self._file = file

    @classmethod
    def take(cls, key: str, text: str) -> Self | None:
        """Take the lock of ``key`` among the programs of this user, with ``text`` for others; None if another program has it.

        Raises:
            OSError: the file cannot be written.
        """
        file = os.open(_path(key), os.O_RDWR | os.O_CREAT | _NO_LINK, 0o600)
        try:
            _lock(file)
        except OSError:
            os.close(file)
            return None
        os.ftruncate(file, 0)
        os.write(file, text.encode())
        return cls(file)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the lock; harmless when repeated."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def text_of(key: str) -> str:
    """Return the text of the program that has the lock of ``key``; empty if it cannot be read."""
    with suppress(OSError):
        return _path(key).read_text(encoding="utf-8", errors="replace")
    return ""


def _path(key: str) -> Path:
    digest = hashlib.sha256(key.encode()).hexdigest()[:16]
    return Path(tempfile.gettempdir()) / f"axisbus-{digest}.lock"


def _lock(file: int) -> None:
    """Lock one byte without waiting; raises OSError if another program has locked it."""
    if sys.platform == "win32":
        os.lseek(file, _LOCKED, os.SEEK_SET)
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        os.lseek(file, 0, os.SEEK_SET)
    else:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
