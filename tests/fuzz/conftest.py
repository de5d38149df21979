"""No thread dies in a fuzz test, or stays behind it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from kit.bus.fake_bus import eventually

HERE = Path(__file__).parent
LONGEST = 240.0  # seconds for all examples of a test, and for those again that a failure is made smaller with


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give a fuzz test more time than its single cases have (``fuzz_frames.within``)."""
    for item in items:
        if item.path.parent == HERE and item.get_closest_marker("timeout") is None:
            item.add_marker(pytest.mark.timeout(LONGEST))


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
