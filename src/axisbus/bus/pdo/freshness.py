"""Maximum age of each input of a drive before it is unknown, and the inputs that must be polled by SDO for that."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Protocol

from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.plan import PdoPlan, PlannedPdo
from axisbus.bus.sdo.transfer import RoundTrips
from axisbus.bus.sdo.worker import SdoJob
from axisbus.cia301.objects import ERROR_REGISTER
from axisbus.cia301.sync import SyncTimes
from axisbus.cia402.port import ValueTransport

SYNC_PERIODS = 5
SYNC_LEAST = 0.1  # seconds: a busy computer may skip some cycles without losing the axis
EVENT_TIMES = 3
EVENT_MARGIN = 0.05
POLLS = 3
POLL_MARGIN = 0.05


# Seconds between two SDO polls of a value.
POLL_PERIODS = {
    "statusword": 0.1,
    "mode": 0.25,
    "position": 0.1,
    "velocity": 0.25,
    "torque": 0.25,
    "demand": 0.25,
}


# Inputs that are polled although a PDO carries them, if that PDO is silent while nothing changes.
_WATCHED = frozenset({"statusword", "position"})


def polls(plan: PdoPlan) -> dict[str, float]:
    """Return the period in seconds of each input that is polled by SDO.

    These are the inputs without a PDO, and statusword and position if their PDO may stay silent. Without an event timer, silence
    proves neither that the drive is alive nor that the axis is at standstill.
    """
    return {name: period for name, period in POLL_PERIODS.items() if _is_polled(plan, name)}


def _is_polled(plan: PdoPlan, name: str) -> bool:
    source = plan.inputs.get(name, ValueTransport.NONE)
    if source is ValueTransport.EVENT_PDO:
        return name in _WATCHED and _pdo_age(plan, name, 0.0) == math.inf
    return source is ValueTransport.SDO


def max_ages(plan: PdoPlan, scan_period: float) -> dict[str, float]:
    """Return the maximum age in seconds of each input of the axis; infinite if silence has no meaning.

    ``scan_period`` (seconds) is the distance of two SYNCs.
    """
    polled = polls(plan)
    ages = {}
    for name, source in plan.inputs.items():
        if name in polled:
            ages[name] = POLLS * polled[name] + POLL_MARGIN
        elif source is not ValueTransport.NONE:
            ages[name] = _pdo_age(plan, name, scan_period)
    return ages


def _pdo_age(plan: PdoPlan, name: str, scan_period: float) -> float:
    """Return the age for the most frequent PDO among those that carry the value."""
    carriers = [pdo for pdo in plan.active if not pdo.receive and name in pdo.values]
    return min((pdo_age(pdo, scan_period) for pdo in carriers), default=math.inf)


def syncs_of(pdo: PlannedPdo) -> int:
    """Return the number of SYNCs per frame of a TPDO; 0 if it is not sent by SYNC, or not always."""
    cyclic = pdo.target.synchronous and pdo.target.transmission_type > 0 and not pdo.request
    return pdo.target.transmission_type if cyclic else 0


def pdo_age(pdo: PlannedPdo, scan_period: float) -> float:
    """Return the seconds without a TPDO after which it counts as missing; infinite if its silence has no meaning."""
    target = pdo.target
    if pdo.request:
        return POLLS * pdo.request + POLL_MARGIN
    if target.synchronous and target.transmission_type > 0:
        return max(SYNC_PERIODS * scan_period * target.transmission_type, SYNC_LEAST)
    if not target.event_timer or target.transmission_type == 0:
        return math.inf
    return EVENT_TIMES * target.event_timer / 1000 + EVENT_MARGIN


# -- Delay of TPDO frames that come without a gap, and the time at which their values were sampled ---------------------
#
# Theory of operation
# A gateway or an adapter whose queue grows delays every frame a little more than the one before. Each frame is fresh by its
# reception, but its values are old. There are three indications:
#
# - *The count.* A synchronous TPDO answers each SYNC, or each n-th. So the newest frame answers SYNC number ``offset + n *
#   frames``, and its values were sampled when that SYNC was sent. SYNCs that the master did not send are not counted, so a busy
#   computer shows no delay. A lost frame (or SYNC) looks like a delay of one period that remains.
# - *Round trips.* An SDO answer limits the delay: the frames after it were sent after the request. So it distinguishes a lost frame
#   from a delayed one, and increases ``offset``. It never decreases ``offset``, because a slow answer is no proof.
#
# - *The start.* A TPDO that had not come before the NMT command *start* answers only SYNCs after that command: frame *k* the *k*-th
#   of them, or a later one. So a drive whose SDO server is slow is distinguished from a link that was slow from the beginning.
#
# While a frame answers one of the newest SYNCs, its values have the time of its reception. Once it is more than ``allowed``
# behind, they have the time of the SYNC, and the master sends an SDO request to the drive (``doubtful``). For ``GRACE`` seconds
# after that the values are regarded as old, but not as unknown: within this time the answer comes. If no answer comes, whole gaps
# between frames count as lost frames for as long as the SDO client tries.
#
# If TPDOs are not counted (event-driven, or with the SYNC of another device), the master sends a request twice a second, and two
# slow answers in succession count as the delay (``LinkLag``). After the first slow answer, and after each one that is slower still,
# the next request follows at once.


GRACE = 0.25  # seconds
LONGEST_ANSWER = 1.6  # seconds that the SDO client may take, with all its attempts
_KNOWN = 0.9  # of the maximum age: within the grace, values are at most this old
ASK_PERIOD = 0.5  # seconds between two requests if TPDOs are not counted
ASK_PAUSE = 0.1  # seconds between two requests if the count, or the delay of the link, is in doubt
JITTER = 0.01  # seconds by which a busy computer may receive a frame late in every cycle
LEAST = 0.03  # seconds; shorter delays of a link whose TPDOs are not counted are ignored
LONGEST = 0.25  # seconds of delay on such a link after which values without a maximum age are unknown


class Counted(Protocol):
    """A TPDO whose frames are counted."""

    frames: int
    latest: tuple[bytes, float]


class SdoSubmitter(Protocol):
    """The SDO worker of a node."""

    def submit(self, job: SdoJob) -> None:
        """Queue a job; does not block."""


class SyncLag:
    """Number of SYNCs by which one synchronous TPDO is behind; holds state: the SYNC that its first frame would have answered."""

    __slots__ = (
        "_before",
        "_created",
        "_doubt_since",
        "_gaps",
        "_max_age",
        "_period",
        "_proved",
        "_since",
        "_slot",
        "_started",
        "_syncs",
        "allowed",
        "every",
        "offset",
    )

    def __init__(
        self,
        slot: Counted,
        syncs: SyncTimes,
        every: int,
        period: float,
        max_age: float,
        started: Callable[[], int | None] = lambda: None,
    ) -> None:
        """Begin to count.

        Args:
            slot: the TPDO.
            syncs: send times of SYNC, one each ``period`` seconds.
            every: number of SYNCs between two of its frames.
            max_age: the seconds for which its values are known.
            started: returns the number of SYNCs before the node was started; None if that is not known.
        """
        self._slot, self._syncs, self._period, self._max_age = slot, syncs, period, max_age
        self._started = started
        self._created = math.inf if slot.frames else syncs.count  # a start before this is of no use
        self.every = every
        self.allowed = every + max(1, math.ceil(JITTER / period))
        self.offset = math.inf  # not known yet
        self._since = math.inf  # operational since this time; later frames are counted
        self._proved = -math.inf  # time of the last answer that was used
        self._doubt_since = math.inf
        self._gaps = 0  # SYNCs without a frame, by the gaps since that time or that answer
        # The frame from which gaps are measured: its time, the SYNC it answers, and the number of SYNCs then.
        self._before = (-math.inf, 0, 0)

    @property
    def doubtful(self) -> bool:
        """Whether it is unknown if frames are lost or late."""
        return self._doubt_since < math.inf

    def step(self, now: float, operational: bool, trips: RoundTrips) -> float:
        """Return the earliest time at which the values of the newest frame were sampled; all times in seconds.

        ``operational``: the node sends the TPDO.
        """
        received = self._slot.latest[1]
        if not operational or not self._syncs.count:
            self.offset = self._since = self._doubt_since = math.inf
            return received
        if self._since == math.inf:
            self._since, self._proved = now, trips.newest[1]
        if self.offset == math.inf and received <= self._since:
            return received
        answered = self._answered(now, received, trips)
        if answered < 1:  # sent before the master's first SYNC: begin with the next frame
            self.offset, self._since = math.inf, received
            return received
        if not self._is_behind(now, received, answered):
            return received
        self._note_gap(received, answered)
        sampled = min(received, self._syncs.time(min(answered + self._gaps, self._syncs.count)))
        if now - self._doubt_since < GRACE:
            sampled = max(sampled, min(received, now - _KNOWN * self._max_age))
        return sampled

    def _answered(self, now: float, received: float, trips: RoundTrips) -> int:
        """Return the number of the SYNC that the newest frame answers, or of an earlier one."""
        syncs, counted = self._syncs, self.every * self._slot.frames
        if self.offset == math.inf:
            answered = syncs.number_at(received - trips.shortest_delay)
            self.offset = max(answered, self._answered_since_start(counted)) - counted
        # A frame beyond the number of SYNCs answers none of them.
        answered = min(int(self.offset) + counted, syncs.count)
        heard = trips.newest[1]
        if heard > self._proved and received >= heard:
            answered = max(answered, syncs.number_at(received - trips.delay()))
            self._proved, self._gaps = heard, 0
        if now - max(self._doubt_since, self._proved) > LONGEST_ANSWER:
            self._gaps = 0
        self.offset = answered - counted
        return answered

    def _answered_since_start(self, counted: int) -> int:
        """Return the earliest SYNC that the newest frame can answer, by the frames since the node was started; 0: unknown."""
        started = self._started()
        return 0 if started is None or started < self._created else started + 1 + counted - self.every

    def _is_behind(self, now: float, received: float, answered: int) -> bool:
        allowed, syncs = self.allowed, self._syncs
        if syncs.count - answered <= allowed and received - syncs.time(answered) <= allowed * self._period:
            self._doubt_since = math.inf
            return False
        if self._doubt_since == math.inf:
            self._doubt_since, self._gaps = now, 0
            self._before = (received, answered, syncs.count)
        return True

    def _note_gap(self, received: float, answered: int) -> None:
        """Count the SYNCs without a frame between two frames, if there was a gap; a growing delay causes no whole gap."""
        before, last, count = self._before
        if received > before:
            syncs = self._syncs
            grown = syncs.count - count - (answered - last)
            longer = received - before - (syncs.time(answered) - syncs.time(last))
            # The time of a SYNC is stored for ``SyncTimes.KEPT`` SYNCs; without it, no gap is proved.
            gap = max(0, round(longer / self._period)) if math.isfinite(longer) else 0
            self._gaps = max(0, self._gaps + (min(grown, gap) if grown > 0 else grown))
            self._before = (received, answered, syncs.count)


class LinkLag:
    """The delay of a link by round trips alone; holds state: the delays by the two newest answers."""

    def __init__(self) -> None:
        self._delays = (0.0, 0.0)
        self._used = -math.inf

    @property
    def doubtful(self) -> bool:
        """Whether the newest answer was slow, and slower than the one before: the delay may grow."""
        before, newest = self._delays
        return newest > LEAST and (before <= LEAST or newest - before > LEAST)

    def step(self, trips: RoundTrips) -> float:
        """Return the delay in seconds that two answers in succession show, 0 if it is below ``LEAST``."""
        if trips.newest[1] > self._used:
            self._used = trips.newest[1]
            self._delays = (self._delays[1], trips.delay())
        delay = min(self._delays)
        return delay if delay > LEAST else 0.0


class Lags:
    """The lag of all TPDOs of one port; holds state: the result of ``look``, and the time of the next request."""

    def __init__(
        self,
        slots: Sequence[tuple[Counted, int, float]],
        period: float,
        syncs: SyncTimes,
        trips: RoundTrips,
        started: Callable[[], int | None] = lambda: None,
    ) -> None:
        """``slots``: each TPDO with the SYNCs from one frame to the next (0: not counted), and its maximum age in seconds.

        ``started``: as in ``SyncLag``.
        """
        self.syncs = syncs
        self.late = 0.0  # seconds, of the latest TPDO
        self._trips = trips
        self._slots = tuple(slot for slot, _, _ in slots)
        self._max_ages = tuple(age for _, _, age in slots)
        self.counts = tuple(
            SyncLag(slot, syncs, every, period, age, started) if every else None for slot, every, age in slots
        )
        self._link = LinkLag() if None in self.counts else None
        self._request_pending = False
        self._last_request = -math.inf
        self._due = -math.inf

    @property
    def is_known(self) -> bool:
        """Whether each counted TPDO has its count."""
        return not self.syncs.count or all(one is None or one.offset < math.inf for one in self.counts)

    @property
    def look_by(self) -> float:
        """Latest time at which ``look`` is needed although frames come as expected."""
        return math.inf if self._link is None else self._due

    def look(self, now: float, operational: bool) -> list[float]:
        """Return the earliest sampling time of each TPDO's newest frame; minus infinity if it is too late."""
        delay = 0.0 if self._link is None else self._link.step(self._trips)
        received = [slot.latest[1] for slot in self._slots]
        sampled = [
            self._without_count(stamp, delay, age) if one is None else one.step(now, operational, self._trips)
            for stamp, age, one in zip(received, self._max_ages, self.counts, strict=True)
        ]
        pairs = zip(received, sampled, strict=True)
        self.late = max((one - other for one, other in pairs if other > -math.inf), default=delay)
        return sampled

    def ask(self, now: float, operational: bool, worker: SdoSubmitter) -> None:
        """Send a request to the node if one is due; does not block. The round trips get its answer."""
        if not operational or self._request_pending or now < self._due:
            return
        doubtful = any(one is not None and one.doubtful for one in (*self.counts, self._link))
        if doubtful or (self._link is not None and now - self._last_request >= ASK_PERIOD):
            self._request_pending, self._last_request = True, now
            self._due = now + ASK_PAUSE
            worker.submit(SdoJob((self, "lag"), ERROR_REGISTER, 0, None, self._ended))
        elif self._link is not None:
            self._due = self._last_request + ASK_PERIOD

    def _ended(self, _value: int | None, _abort: int | None) -> None:
        self._request_pending = False

    @staticmethod
    def _without_count(received: float, delay: float, max_age: float) -> float:
        return -math.inf if delay > LONGEST and max_age == math.inf else received - delay


def lags_of(
    slots: Sequence[tuple[Counted, PlannedPdo]], scan_period: float, node: CanopenNode, foreign_sync: bool
) -> Lags:
    """Return the lags of the TPDOs of a node's port; ``foreign_sync``: another device sends SYNC, so none is counted."""
    counted = [(slot, 0 if foreign_sync else syncs_of(pdo), pdo_age(pdo, scan_period)) for slot, pdo in slots]
    return Lags(counted, scan_period, node.channel.syncs, node.sdo.trips, lambda: node.nmt.started)
