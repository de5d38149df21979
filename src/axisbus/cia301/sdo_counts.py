"""Count the outcomes of SDO transfers by node, to show lost frames before they make a transfer fail."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from enum import Enum

from axisbus.cia301.sdo import Garbled, NoAnswer, SdoAborted
from axisbus.cia301.sdo_session import BROKEN_DIALOGUE


class SdoOutcome(Enum):
    """Outcome of a transfer after all its attempts, as reported to the caller."""

    DONE = "done"
    ABORTED = "aborted"  # the node refused it
    UNANSWERED = "unanswered"
    BROKEN = "broken"  # protocol violations in the last attempt
    CUT_SHORT = "cut short"  # by a more urgent request, or by a bus failure


@dataclass(frozen=True, slots=True)
class SdoCount:
    """The transfers with one node so far by outcome, and the number of repeated attempts (``retries``)."""

    node: int
    done: int = 0
    aborted: int = 0
    unanswered: int = 0
    broken: int = 0
    cut_short: int = 0
    retries: int = 0

    @property
    def ends(self) -> dict[SdoOutcome, int]:
        """Number of transfers for each outcome."""
        return {
            SdoOutcome.DONE: self.done,
            SdoOutcome.ABORTED: self.aborted,
            SdoOutcome.UNANSWERED: self.unanswered,
            SdoOutcome.BROKEN: self.broken,
            SdoOutcome.CUT_SHORT: self.cut_short,
        }


class SdoCounts:
    """Counter of outcomes; holds state: a count for each node and outcome, and the retries of each node."""

    def __init__(self, lock: AbstractContextManager[object] | None = None) -> None:
        """``lock`` is held while counting; give one if several threads use this."""
        self._lock = nullcontext() if lock is None else lock
        self._ends: Counter[tuple[int, SdoOutcome]] = Counter()
        self._retries: Counter[int] = Counter()

    def note(self, node: int, end: SdoOutcome, retries: int) -> None:
        """Count one transfer that has ended; ``retries`` is its number of attempts after the first."""
        with self._lock:
            self._ends[node, end] += 1
            self._retries[node] += retries

    @property
    def found(self) -> tuple[SdoCount, ...]:
        """The counts so far, by node."""
        with self._lock:
            ends, retries = dict(self._ends), dict(self._retries)
        return tuple(_of(node, ends, retries[node]) for node in sorted(retries))


def _of(node: int, ends: Mapping[tuple[int, SdoOutcome], int], retries: int) -> SdoCount:
    counts = {end.name.lower(): ends.get((node, end), 0) for end in SdoOutcome}
    return SdoCount(node, **counts, retries=retries)


def end_of(failure: NoAnswer | Garbled | SdoAborted | None) -> SdoOutcome:
    """Return the outcome of a session that ran to its end; ``failure`` is the one of the session."""
    if failure is None:
        return SdoOutcome.DONE
    if isinstance(failure, NoAnswer):
        return SdoOutcome.UNANSWERED
    refused = isinstance(failure, SdoAborted) and failure.code not in BROKEN_DIALOGUE
    return SdoOutcome.ABORTED if refused else SdoOutcome.BROKEN
