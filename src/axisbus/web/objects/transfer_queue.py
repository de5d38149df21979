"""Whose turn it is: the transfers that all pages wait for, one after the other, and what each page is to be told of them.

Theory of operation
-------------------
There is one transfer at a time for the whole server, and a pause between two (``worker``): however many pages look on, that is all
that they put on the bus. Two kinds take turns. What is asked for once, reading or writing, comes page by page. What is kept being
read comes in the order of how long ago it was read last, each at most every ``PERIOD``, once for all the pages that keep it.

A node that does not answer holds the others up for as long as a transfer is tried. So whatever else waits to be read of it has
come to the same then, and what is kept being read of it is left alone for ``QUIET``.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from axisbus.web.objects.jobs import ObjectJob, TransferResult
from axisbus.web.objects.key import ObjectKey

PERIOD = 0.5  # seconds between two readings of what is kept being read
QUIET = 5.0  # seconds in which a node that does not answer is not asked again by itself
WAITING = 64  # transfers of one page that may wait
_DROPPED = {
    "message": "it was not written: this page has the controls no longer",
    "observed": "",
    "remedy": "take them, and write it again",
}


@dataclass(slots=True)
class _Page:
    asked: deque[ObjectJob] = field(default_factory=deque)
    kept: tuple[ObjectKey, ...] = ()
    # by who asked for it (0: it is kept), the newest of each object
    news: dict[tuple[int, ObjectKey], TransferResult] = field(default_factory=dict)


class TransferQueue:
    """Holds what the pages wait for, and what they were not told yet; used by one thread. Times are seconds of one clock."""

    def __init__(self) -> None:
        self._pages: dict[int, _Page] = {}
        self._last: dict[ObjectKey, float] = {}
        self._quiet: dict[int, float] = {}
        self._kept_first = False

    def ask(self, page: int, jobs: Sequence[ObjectJob]) -> bool:
        """Let transfers of a page wait; False where too many do already, and then none of them is taken."""
        place = self._pages.setdefault(page, _Page())
        if len(place.asked) + len(jobs) > WAITING:
            return False
        place.asked.extend(jobs)
        return True

    def keep(self, page: int, keys: Iterable[ObjectKey]) -> None:
        """Let a page keep reading these, and no others any more."""
        self._pages.setdefault(page, _Page()).kept = tuple(dict.fromkeys(keys))
        self._tidy()

    def drop_writes(self, page: int, now: float) -> None:
        """Write nothing more for a page: it has the controls no longer."""
        place = self._pages.get(page)
        if place is None:
            return
        dropped = [job for job in place.asked if job.wish is not None]
        place.asked = deque(job for job in place.asked if job.wish is None)
        place.news.update({(page, job.key): TransferResult(job, now, error=_DROPPED) for job in dropped})

    def leave(self, page: int) -> None:
        """A page is gone."""
        self._pages.pop(page, None)
        self._tidy()

    def next(self, now: float) -> ObjectJob | None:
        """Return the transfer whose turn it is; None while nothing is to be done."""
        job = self._of_kept(now) if self._kept_first else None
        job = job or self._of_asked() or self._of_kept(now)
        if job is not None:
            self._kept_first = job.page != 0
        return job

    def done(self, seen: TransferResult, now: float) -> None:
        """A transfer has come to something: whoever waits for it, or keeps reading it, is told."""
        job = seen.job
        if seen.silent:
            self._quiet[job.key.node] = now + QUIET
            self._give_up(job.key.node, seen)
        for_all = job.wish is None or seen.value is not None  # what is refused to one is for nobody else
        for number, place in self._pages.items():
            if number == job.page or (for_all and job.key in place.kept):
                place.news[job.page, job.key] = seen

    def news(self, page: int) -> list[TransferResult]:
        """Return what a page was not told yet."""
        place = self._pages.get(page)
        if place is None or not place.news:
            return []
        found, place.news = list(place.news.values()), {}
        return found

    def _of_asked(self) -> ObjectJob | None:
        for number, place in list(self._pages.items()):
            if place.asked:
                self._pages[number] = self._pages.pop(number)  # the others come first then
                return place.asked.popleft()
        return None

    def _of_kept(self, now: float) -> ObjectJob | None:
        keys = [key for key in self._kept() if self._quiet.get(key.node, 0.0) <= now]
        key = min(keys, key=self._read_last, default=None)
        if key is None or now - self._read_last(key) < PERIOD:
            return None
        self._last[key] = now
        return ObjectJob(key)

    def _read_last(self, key: ObjectKey) -> float:
        return self._last.get(key, -math.inf)

    def _give_up(self, node: int, seen: TransferResult) -> None:
        for number, place in self._pages.items():
            hopeless = [job for job in place.asked if job.key.node == node and job.wish is None]
            place.asked = deque(job for job in place.asked if job not in hopeless)
            place.news.update({(number, job.key): replace(seen, job=job) for job in hopeless})

    def _kept(self) -> set[ObjectKey]:
        return {key for place in self._pages.values() for key in place.kept}

    def _tidy(self) -> None:
        kept = self._kept()
        self._last = {key: last for key, last in self._last.items() if key in kept}
