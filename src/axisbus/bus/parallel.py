"""The same work on several nodes in parallel: each thread waits for the answers of its node."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

from axisbus.clock import Clock

_T = TypeVar("_T")


class _Work(Generic[_T]):
    """One call in a thread of its own; holds its result, or what it raised."""

    def __init__(self, work: Callable[..., _T], given: tuple[object, ...]) -> None:
        self._work, self._given = work, given
        self._results: list[_T] = []
        self._error: BaseException | None = None

    def run(self) -> None:
        """Do the work."""
        try:
            self._results.append(self._work(*self._given))
        except BaseException as error:  # noqa: BLE001 - raised where the result is taken
            self._error = error

    def result(self) -> _T:
        """Return the result, or raise the error."""
        if self._error is not None:
            raise self._error
        return self._results[0]


def in_parallel(clock: Clock, work: Callable[..., _T], *items: Iterable[object]) -> list[_T]:
    """Call ``work`` with one item of each iterable, each call in a thread; sequentially if no threads can be started.

    At the end of the interpreter no threads can be started, when ``atexit`` closes a machine that was left open.
    """
    works = [_Work(work, given) for given in zip(*items, strict=True)]
    threads = [clock.thread(one.run, f"axisbus node {number}") for number, one in enumerate(works, 1)]
    begun = 0
    try:
        for thread in threads:
            thread.start()
            begun += 1
    except RuntimeError:  # the interpreter is ending
        for one in works[begun:]:
            one.run()
    for thread in threads[:begun]:
        thread.join()
    return [one.result() for one in works]
