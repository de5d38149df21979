"""Another user of this computer, for tests that run as root."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

STRANGER = 12346  # the ID of a user, and of a group, that no account has
needs_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can be another user for a while"
)


@contextmanager
def as_user(make: Callable[[], object], user: int = STRANGER) -> Iterator[int]:
    """Let a child process of another user make something and keep it until the end of the block; yields its ID."""
    ready, tell = os.pipe()
    child = os.fork()
    if child == 0:
        kept = None
        try:
            os.setgroups([])
            os.setgid(user)
            os.setuid(user)
            kept = make()
            os.write(tell, b"r")
            signal.pause()
        finally:
            os._exit(int(kept is None))
    os.close(tell)
    try:
        assert os.read(ready, 1) == b"r", "the other user could not do it"
        yield child
    finally:
        os.close(ready)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
