"""The same work on several nodes in parallel: each thread waits for the answers of its node."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

_T = TypeVar("_T")


def in_parallel(work: Callable[..., _T], *items: Iterable[object]) -> list[_T]:
    """Call ``work`` with one item of each iterable, each call in a thread; sequentially if no threads can be started.

    At the end of the interpreter no threads can be started, when ``atexit`` closes a machine that was left open.
    """
    places = list(zip(*items, strict=True))
    pool = ThreadPoolExecutor(max_workers=max(1, len(places)), thread_name_prefix="axisbus nodes")
    begun: list[Future[_T]] = []
    try:
        with pool:
            begun += [pool.submit(work, *place) for place in places]
    except RuntimeError:
        pass  # the interpreter is ending
    return [future.result() for future in begun] + [work(*place) for place in places[len(begun) :]]
