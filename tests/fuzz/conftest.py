"""What the fuzzers share with other tests (fake bus, stand-ins, command line); and that no thread dies or stays."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

for _folder in ("bus", "stories", "cli"):
    sys.path.append(str(Path(__file__).parents[1] / _folder))


@pytest.fixture(autouse=True)
def no_thread_left() -> Iterator[None]:
    """Fail where a thread of the package is still there behind a test, or has died of an exception."""
    from bus_peer import eventually

    before, died = set(threading.enumerate()), []
    hook, threading.excepthook = threading.excepthook, died.append
    try:
        yield
    finally:
        threading.excepthook = hook
    assert not died
    eventually(
        lambda: not [t for t in threading.enumerate() if t not in before and t.name.startswith("axisbus")]
    )
