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

from axisbus.bus.link.channel import Receiver
from axisbus.bus.pdo.freshness import Lags
from axisbus.bus.pdo.plan import PlannedPdo
from axisbus.bus.pdo.sdo_exchange import Poller
from axisbus.bus.pdo.tpdo_timeout import Deadline, Deadlines, PdoEvent
from axisbus.cia301.pdo import PdoCodec
from axisbus.cia402.port import INPUT_OBJECTS, Sample

_NAMES = tuple(INPUT_OBJECTS)
_tuple = tuple.__new__  # makes a named tuple from fitting values without the cost of its own ``__new__``


class TpdoInputs:
    """Holds the newest sample of each input, by name in ``samples``; the methods return them in the order of ``Inputs``."""

    __slots__ = (
        "_counts",
        "_deadlines",
        "_known",
        "_lags",
        "_longest_gap",
        "_now",
        "_slots",
        "_syncs",
        "_unrecorded",
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
        self._unrecorded = False  # whether ``_known`` is newer than ``samples`` and the deadlines
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
            for position, input_index in slot.input_indices:
                known[input_index] = _tuple(Sample, (values[position], stamp))
        self._unrecorded, self._now = True, now
        return known

    def look(
        self, now: float, operational: bool, poller: Poller | None
    ) -> tuple[list[Sample | None], list[PdoEvent]]:
        """Return the newest samples and the events of the TPDOs; ``operational``: the TPDOs are expected."""
        if self._unrecorded:
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

    def forget(self) -> None:
        """Discard all values; each counts again with its next frame or poll."""
        self.samples.clear()
        for slot, _ in self._slots:
            slot.seen = slot.latest
        self.steady = self._unrecorded = False

    def _catch_up(self) -> None:
        self._unrecorded = False
        self.samples.update(
            (name, sample) for name, sample in zip(_NAMES, self._known, strict=True) if sample
        )
        self._deadlines.met([slot.seen[1] for slot, _ in self._slots], self._now)

    def _are_only_sources(self, known: Sequence[Sample | None]) -> bool:
        """Whether each value of a TPDO is the one from the last frame of this TPDO."""
        input_indices = [input_index for slot, _ in self._slots for _, input_index in slot.input_indices]
        return len(set(input_indices)) == len(input_indices) and all(
            (sample := known[input_index]) is not None and sample.stamp == slot.seen[1]
            for slot, _ in self._slots
            for _, input_index in slot.input_indices
        )


def _unless_too_late(sample: Sample | None) -> Sample | None:
    return None if sample is None or sample.stamp == -math.inf else sample


# -- The newest frame of one TPDO, stored by the receive thread and decoded once by the scan ---------------------------


_INPUT_INDICES = {name: input_index for input_index, name in enumerate(INPUT_OBJECTS)}


class TpdoSlot:
    """The newest frame of a TPDO.

    Holds state: one (data, stamp) pair, replaced as a whole, so that a reader never sees half of one.

    A frame shorter than the mapping is not decoded; it is counted in ``short``, and its values grow old. Surplus bytes of a longer
    frame are ignored (CiA 301 7.2.2.5). ``latest`` is the newest pair, ``seen`` the pair that the one reader has read last.
    ``frames`` counts all frames, whole or short. ``input_indices`` assigns the frame's values to inputs, by position in both.
    """

    __slots__ = (
        "_drop",
        "_names",
        "cob_id",
        "frames",
        "input_indices",
        "latest",
        "name",
        "request",
        "seen",
        "short",
        "size",
        "unpack",
    )

    def __init__(self, pdo: PlannedPdo, drop: Receiver | None = None) -> None:
        """``drop(data, stamp)`` is called with a frame that is too short."""
        self.name = pdo.name
        self.cob_id = pdo.target.cob_id
        self.request = pdo.request
        self.frames = 0
        codec = PdoCodec(pdo.target.mapping, pdo.signed)
        self.size = codec.size  # data bytes of a whole frame
        self.unpack = codec.unpack_from
        self._names = tuple((position, name) for position, name in enumerate(pdo.values) if name is not None)
        self.input_indices = tuple((position, _INPUT_INDICES[name]) for position, name in self._names)
        self._drop = drop
        self.latest = self.seen = (b"", -math.inf)

    @property
    def stamp(self) -> float:
        """Time of the newest whole frame in seconds; minus infinity if there is none."""
        return self.latest[1]

    def on_frame(self, data: bytes, stamp: float) -> None:
        """Store a frame; called in the receive thread."""
        self.frames += 1
        if len(data) < self.size:
            if self._drop is not None:
                self._drop(data, stamp)
            return
        self.latest = (data, stamp)

    def read_into(self, samples: dict[str, Sample], sampled: float) -> float:
        """Put the values of a frame that has come since the last call into ``samples`` if they are newer; for one reader.

        ``sampled``: the earliest time at which they were sampled (seconds). Return the frame's ``stamp``.
        """
        latest = self.latest
        data, stamp = latest
        if latest is self.seen:
            return stamp
        self.seen = latest
        values = self.unpack(data)
        for position, name in self._names:
            known = samples.get(name)
            if known is None or known.stamp <= stamp:
                samples[name] = _tuple(Sample, (values[position], sampled))
        return stamp


class Requests:
    """Schedule of the TPDOs that are sent only on request; holds state: the due time of each. Empty if there are none."""

    def __init__(self, slots: Sequence[TpdoSlot]) -> None:
        self._slots = tuple(slot for slot in slots if slot.request > 0.0)
        self._due = [-math.inf] * len(self._slots)

    def __bool__(self) -> bool:
        return bool(self._slots)

    def due(self, now: float) -> list[tuple[int, int]]:
        """Return COB-ID and data length of each TPDO to request now; ``now`` in seconds."""
        asked = [number for number, due in enumerate(self._due) if now >= due]
        for number in asked:
            period = self._slots[number].request
            due = self._due[number] + period
            self._due[number] = due if due > now else now + period
        return [(self._slots[number].cob_id, self._slots[number].size) for number in asked]
