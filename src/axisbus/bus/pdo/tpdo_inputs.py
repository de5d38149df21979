"""The values from the TPDOs of one axis and their reception deadlines, checked once in each cycle.

Theory of operation
-------------------
In nearly every cycle each TPDO has come once more, or is not late yet. Then there is nothing to report and nothing to compare: the
values of a new frame are the newest ones, and its deadline restarts. The same applies as long as no TPDO is behind the SYNCs
(``lag``). ``renewed`` does only that, and does not update the samples and deadlines of ``look``; ``look`` updates them first.
``look`` also determines whether ``renewed`` may be used: ``steady``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from axisbus.bus.pdo.lag import Lags
from axisbus.bus.pdo.poller import Poller
from axisbus.bus.pdo.tpdo import TpdoSlot
from axisbus.bus.pdo.tpdo_timeout import Deadline, Deadlines, PdoEvent
from axisbus.cia402.port import INPUT_OBJECTS, Sample

_NAMES = tuple(INPUT_OBJECTS)
_tuple = tuple.__new__  # makes a named tuple from fitting values without the cost of its own ``__new__``


class Incoming:
    """Holds the newest sample of each input, by name in ``samples``; the methods return them in the order of ``Inputs``."""

    __slots__ = (
        "_ahead",
        "_counts",
        "_deadlines",
        "_known",
        "_lags",
        "_longest_gap",
        "_now",
        "_slots",
        "_syncs",
        "samples",
        "steady",
    )

    def __init__(self, slots: Sequence[tuple[TpdoSlot, Deadline]], period: float, lags: Lags) -> None:
        """``slots``: each TPDO with its deadline; ``period``: of the scan, in seconds; ``lags``: of the TPDOs, in this order."""
        self._slots = tuple((slot, deadline.age) for slot, deadline in slots)
        self._lags, self._syncs = lags, lags.syncs
        counted = zip(self._slots, lags.counts, strict=True)
        self._counts = tuple((slot, lag) for (slot, _), lag in counted if lag is not None)
        self._deadlines = Deadlines([deadline for _, deadline in slots], period)
        self._longest_gap = 2 * period  # between two calls; after a longer gap ``look`` must decide
        self.samples: dict[str, Sample] = {}
        self._known: list[Sample | None] = [None] * len(_NAMES)
        self.steady = False  # whether ``renewed`` may be called
        self._ahead = False  # whether ``_known`` is newer than ``samples`` and the deadlines
        self._now = -math.inf  # of the last call

    def renewed(self, now: float) -> list[Sample | None] | None:
        """Return the newest samples if no TPDO is late, else None: then call ``look``. For an axis that is ``steady``."""
        if now - self._now > self._longest_gap:
            return None
        count = self._syncs.count
        for slot, lag in self._counts:
            if count - lag.every * slot.frames - lag.offset > lag.allowed:
                return None
        frames = []
        for slot, age in self._slots:
            latest, seen = slot.latest, slot.seen
            if latest is seen:
                if now - seen[1] > age:
                    return None
            elif latest[1] > seen[1]:
                frames.append((slot, latest))
            else:
                return None
        known = self._known
        for slot, latest in frames:
            slot.seen = latest
            data, stamp = latest
            values = slot.unpack(data)
            for position, place in slot.places:
                known[place] = _tuple(Sample, (values[position], stamp))
        self._ahead, self._now = True, now
        return known

    def look(
        self, now: float, operational: bool, poller: Poller | None
    ) -> tuple[list[Sample | None], list[PdoEvent]]:
        """Return the newest samples and the events of the TPDOs; ``operational``: the TPDOs are expected."""
        if self._ahead:
            self._catch_up()
        samples = self.samples
        sampled = self._lags.look(now, operational)
        stamps = [slot.read_into(samples, when) for (slot, _), when in zip(self._slots, sampled, strict=True)]
        events = self._deadlines.step(now, stamps, operational)
        if poller is not None:
            poller.read_into(samples)
            poller.poll(now)
        self._known = known = [_unless_too_late(samples.get(name)) for name in _NAMES]
        self._now = now
        self.steady = (
            poller is None
            and operational
            and self._lags.is_known
            and self._deadlines.all_met(stamps)
            and self._are_only_sources(known)
        )
        return known, events

    def _catch_up(self) -> None:
        self._ahead = False
        self.samples.update(
            (name, sample) for name, sample in zip(_NAMES, self._known, strict=True) if sample
        )
        self._deadlines.met([slot.seen[1] for slot, _ in self._slots], self._now)

    def _are_only_sources(self, known: Sequence[Sample | None]) -> bool:
        """Whether each value of a TPDO is the one from the last frame of this TPDO."""
        places = [place for slot, _ in self._slots for _, place in slot.places]
        return len(set(places)) == len(places) and all(
            (sample := known[place]) is not None and sample.stamp == slot.seen[1]
            for slot, _ in self._slots
            for _, place in slot.places
        )


def _unless_too_late(sample: Sample | None) -> Sample | None:
    return None if sample is None or sample.stamp == -math.inf else sample
