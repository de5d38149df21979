"""The fake bus of the bus tests, for the fuzzers that need a channel."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "bus"))


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
