"""No thread dies in a fuzz test, or stays behind it."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from kit.bus.peer import eventually


@pytest.fixture(autouse=True)
def no_thread_left() -> Iterator[None]:
    """Fail where a thread of the package is still there behind a test, or has died of an exception."""
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
