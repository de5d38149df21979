"""Work that is done again and again in another thread."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def again(work: Callable[[], object], pause: float) -> Iterator[None]:
    """Do ``work`` while the block runs, ``pause`` seconds after the block begins and after each time."""
    over = threading.Event()

    def run() -> None:
        while not over.wait(pause):
            work()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
