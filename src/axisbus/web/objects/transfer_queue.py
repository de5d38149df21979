"""The queue of SDO transfers that all pages wait for: their order, and the results for each page.

Theory of operation
-------------------
The whole server runs one transfer at a time, with a pause between two (``worker``), so the load on the bus does not grow with the
number of pages. Two kinds of transfers alternate. One-time requests, reading or writing, are served page by page. Objects that are
read cyclically come in the order of their last reading, each at most every ``PERIOD``, once for all pages that read it.

A node that does not answer delays all others for as long as a transfer is tried. So all other waiting reads of this node get the
same result, and the cyclic reads of it pause for ``QUIET``.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from axisbus.web.view import Values

PERIOD = 0.5  # seconds between two cyclic reads of an object
QUIET = 5.0  # seconds for which a node that does not answer is not read cyclically
WAITING = 64  # the most waiting transfers of one page
_DROPPED = {
    "message": "it was not written: this page no longer has the controls",
    "observed": "",
    "remedy": "take the controls, and write it again",
}


@dataclass(slots=True)
class _Page:
    requested: deque[ObjectJob] = field(default_factory=deque)
    cyclic: tuple[ObjectKey, ...] = ()
    # by the requesting page (0: cyclic) and object, the newest result of each
    unread: dict[tuple[int, ObjectKey], TransferResult] = field(default_factory=dict)


class TransferQueue:
    """Hold the waiting transfers of the pages and their unread results; used by one thread. Times are seconds of one clock."""

    def __init__(self) -> None:
        self._pages: dict[int, _Page] = {}
        self._last: dict[ObjectKey, float] = {}
        self._quiet: dict[int, float] = {}
        self._cyclic_first = False

    def request(self, page: int, jobs: Sequence[ObjectJob]) -> bool:
        """Queue transfers of a page; return False, and queue none of them, if too many are waiting."""
        page_state = self._pages.setdefault(page, _Page())
        if len(page_state.requested) + len(jobs) > WAITING:
            return False
        page_state.requested.extend(jobs)
        return True

    def set_cyclic(self, page: int, keys: Iterable[ObjectKey]) -> None:
        """Set the objects that a page reads cyclically, replacing the previous ones."""
        self._pages.setdefault(page, _Page()).cyclic = tuple(dict.fromkeys(keys))
        self._drop_unused()

    def drop_writes(self, page: int, now: float) -> None:
        """Drop the pending writes of a page, because it has lost the controls."""
        page_state = self._pages.get(page)
        if page_state is None:
            return
        dropped = [job for job in page_state.requested if job.write_request is not None]
        page_state.requested = deque(job for job in page_state.requested if job.write_request is None)
        page_state.unread.update(
            {(page, job.key): TransferResult(job, now, error=_DROPPED) for job in dropped}
        )

    def remove_page(self, page: int) -> None:
        """Remove a closed page."""
        self._pages.pop(page, None)
        self._drop_unused()

    def next(self, now: float) -> ObjectJob | None:
        """Return the next transfer; None while there is none."""
        job = self._next_cyclic(now) if self._cyclic_first else None
        job = job or self._next_requested() or self._next_cyclic(now)
        if job is not None:
            self._cyclic_first = job.page != 0
        return job

    def store_result(self, result: TransferResult, now: float) -> None:
        """Store the result of a transfer for the page that waits for it and for those that read the object cyclically."""
        job = result.job
        if result.silent:
            self._quiet[job.key.node] = now + QUIET
            self._fail_reads(job.key.node, result)
        for_all = (
            job.write_request is None or result.value is not None
        )  # a refused write is reported to its page only
        for number, page_state in self._pages.items():
            if number == job.page or (for_all and job.key in page_state.cyclic):
                page_state.unread[job.page, job.key] = result

    def unread(self, page: int) -> list[TransferResult]:
        """Return the results that a page has not received yet."""
        page_state = self._pages.get(page)
        if page_state is None or not page_state.unread:
            return []
        found, page_state.unread = list(page_state.unread.values()), {}
        return found

    def _next_requested(self) -> ObjectJob | None:
        for number, page_state in list(self._pages.items()):
            if page_state.requested:
                self._pages[number] = self._pages.pop(number)  # so that the other pages come first
                return page_state.requested.popleft()
        return None

    def _next_cyclic(self, now: float) -> ObjectJob | None:
        keys = [key for key in self._cyclic_keys() if self._quiet.get(key.node, 0.0) <= now]
        key = min(keys, key=self._read_last, default=None)
        if key is None or now - self._read_last(key) < PERIOD:
            return None
        self._last[key] = now
        return ObjectJob(key)

    def _read_last(self, key: ObjectKey) -> float:
        return self._last.get(key, -math.inf)

    def _fail_reads(self, node: int, result: TransferResult) -> None:
        for number, page_state in self._pages.items():
            failed = [
                job for job in page_state.requested if job.key.node == node and job.write_request is None
            ]
            page_state.requested = deque(job for job in page_state.requested if job not in failed)
            page_state.unread.update({(number, job.key): replace(result, job=job) for job in failed})

    def _cyclic_keys(self) -> set[ObjectKey]:
        return {key for page_state in self._pages.values() for key in page_state.cyclic}

    def _drop_unused(self) -> None:
        cyclic = self._cyclic_keys()
        self._last = {key: last for key, last in self._last.items() if key in cyclic}


# -- An SDO transfer that a page waits for, and its result as sent to the page -----------------------------------------


@dataclass(frozen=True, slots=True)
class TransferRequest:
    """A value to write, as typed, and the reasons for a question that the user has confirmed."""

    text: str
    agreed: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class ObjectJob:
    """One transfer: ``page`` has requested it (0: cyclic read); ``write_request`` is None if it reads."""

    key: ObjectKey
    page: int = 0
    write_request: TransferRequest | None = None


@dataclass(frozen=True, slots=True)
class WriteConfirmation:
    """A question to confirm before an object is written; ``reasons`` say why it is asked, and come back with the confirmation."""

    text: str
    reasons: frozenset[str]


@dataclass(frozen=True, slots=True)
class TransferResult:
    """The result of a transfer at ``stamp`` (s, monotonic).

    ``value`` is the value of the object, None if unknown; ``error`` are the three texts of an error, ``note`` is the result of a
    write in words. ``silent``: the node did not answer.
    """

    job: ObjectJob
    stamp: float
    value: str | None = None
    error: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    question: WriteConfirmation | None = None
    silent: bool = False

    def as_values(self, now: float) -> Values:
        """Return the result as plain values, with its age in seconds."""
        requested = self.question
        return {
            "key": str(self.job.key),
            "wrote": self.job.write_request is not None,
            "age": round(max(0.0, now - self.stamp), 3),
            "value": self.value,
            "error": dict(self.error) or None,
            "note": self.note,
            "question": None
            if requested is None
            else {"text": requested.text, "reasons": " ".join(sorted(requested.reasons))},
        }


# -- The address of an object of a node, written as ``1:6064:00`` between page and server ------------------------------


_SPELT = re.compile(r"([0-9]{1,3}):([0-9A-F]{4}):([0-9A-F]{2})", re.ASCII)


@dataclass(frozen=True, slots=True)
class ObjectKey:
    """One object of one node."""

    node: int
    index: int
    subindex: int

    def __str__(self) -> str:
        return f"{self.node}:{self.index:04X}:{self.subindex:02X}"


def read(text: object) -> ObjectKey | None:
    """Return the object that a text names; None if the text is invalid."""
    found = _SPELT.fullmatch(text) if isinstance(text, str) else None
    return None if found is None else ObjectKey(int(found[1]), int(found[2], 16), int(found[3], 16))
