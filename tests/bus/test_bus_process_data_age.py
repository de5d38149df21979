"""How late process data are: by the count of SYNCs and answers, and by round trips; drives, links and clocks are drawn here."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from axisbus.bus.pdo.freshness import (
    ASK_PAUSE,
    ASK_PERIOD,
    GRACE,
    JITTER,
    LONGEST,
    LONGEST_ANSWER,
    Lags,
    LinkLag,
)
from axisbus.bus.sdo.transfer import ALLOWED, RoundTrips
from axisbus.bus.sdo.worker import SdoJob
from axisbus.cia301.sync import SyncTimes

SDO_TIMEOUT = 0.5  # seconds until a request is repeated
SERVER = 0.004  # seconds that a node takes at least to answer an SDO request


class Worker:
    """The SDO worker of a node."""

    def __init__(self) -> None:
        self.jobs: list[SdoJob] = []

    def submit(self, job: SdoJob) -> None:
        self.jobs.append(job)


@dataclass
class World:
    """A drive that answers SYNC over a link with delays, and the scan that looks at it once in each period.

    ``lag`` gives the delay of the link (seconds) at a time; the order of frames is kept. ``lost`` is the share of its
    TPDOs that get lost, ``mute`` the share of SDO answers.
    """

    seed: int
    period: float = 0.01
    every: int = 1
    lag: Callable[[float], float] = lambda _: 0.0
    lost: float = 0.0
    burst: int = 1
    mute: float = 0.0
    jitter: float = 0.0
    late_cycles: float = 0.0
    answers_after: float = 0.3  # of a period
    max_age: float = 0.0
    now: float = 100.0
    came: list[tuple[float, float | None]] = field(
        default_factory=list
    )  # when a frame comes, and when it was sampled
    looks: list[tuple[float, float, float]] = field(
        default_factory=list
    )  # time, stated and true time of the newest sample

    def __post_init__(self) -> None:
        self.max_age = self.max_age or max(5 * self.period * self.every, 0.1)
        self.dice = random.Random(self.seed)
        self.syncs, self.trips = SyncTimes(), RoundTrips()
        self.slot = SimpleNamespace(frames=0, latest=(b"", -1e9))
        self.lags = Lags([(self.slot, self.every, self.max_age)], self.period, self.syncs, self.trips)
        self.sampled, self.last, self.left, self.asks = -1e9, 0.0, 0, 0
        self.trips.note(self.now - 1.0, self.now - 1.0 + SERVER)
        self.answer: tuple[float, float] | None = None
        self.ended: Callable[[int | None, int | None], None] = lambda *_: None

    def deliver(self, sent: float, sampled: float | None) -> float:
        """Let a frame that is sent now come later, behind the one before."""
        self.last = max(self.last, sent + self.lag(sent) + self.dice.uniform(0, self.jitter))
        if sampled is not None:
            self.came.append((self.last, sampled))
        return self.last

    def drive(self, number: int) -> None:
        """Answer the SYNC that was sent now."""
        if number % self.every:
            return
        if not self.left and self.dice.random() < self.lost:
            self.left = self.dice.randint(1, self.burst)
        if self.left:
            self.left -= 1
        else:
            self.deliver(self.now + self.answers_after * self.period, self.now)

    def cycle(self) -> None:
        self.now += self.period * (self.dice.randint(2, 30) if self.dice.random() < self.late_cycles else 1)
        self.syncs.note(self.now)
        self.drive(self.syncs.count)
        while self.came and self.came[0][0] <= self.now:
            stamp, self.sampled = self.came.pop(0)
            self.slot.frames += 1
            self.slot.latest = (b"", stamp)
        if self.answer is not None and self.answer[1] <= self.now:
            self.trips.note(*self.answer)
            self.ended(None, None)
            self.answer = None
        (stated,) = self.lags.look(self.now, True)
        if self.sampled > 0:
            self.looks.append((self.now, stated, self.sampled))
        self.lags.ask(self.now, True, self)

    def submit(self, job: SdoJob) -> None:
        """As the node's SDO worker."""
        self.ended = job.done
        self.asks += 1
        if self.dice.random() >= self.mute:
            heard = self.deliver(self.now + SERVER * self.dice.uniform(1, 3), None)
            self.answer = (self.now, heard)
        elif self.mute < 1:
            asked = self.now + SDO_TIMEOUT  # again
            self.answer = (asked, asked + SERVER + self.lag(asked))
        else:
            self.answer = (-1e9, self.now + LONGEST_ANSWER)

    def run(self, seconds: float) -> World:
        until = self.now + seconds
        while self.now < until:
            self.cycle()
        return self

    def oldest(self) -> float:
        """The greatest age that was stated, without the effect of late cycles."""
        return max(now - stated for now, stated, _ in self.looks)


KINDS = {
    "steady": {},
    "every third": {"every": 3},
    "every 240th": {"every": 240},
    "after the next SYNC": {"answers_after": 1.4},
    "fast": {"period": 0.001, "jitter": 0.004},
    "slow": {"period": 0.05},
    "jitter": {"jitter": 0.015},
    "a constant delay": {"lag": lambda _: 0.03},
    "late cycles": {"late_cycles": 0.02},
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", KINDS)
def test_data_in_time_have_their_reception_time_within_the_tolerance(kind: str, seed: int) -> None:
    world = World(seed, **KINDS[kind]).run(60.0 if kind != "every 240th" else 400.0)
    longest = max(later - earlier for (earlier, _, _), (later, _, _) in itertools.pairwise(world.looks))
    assert world.oldest() - longest <= world.max_age


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    "kind",
    [
        {"lost": 0.05},
        {"lost": 0.02, "burst": 3},
        {"lost": 0.3},  # a drive that passes SYNCs over
        {"lost": 0.02, "burst": 3, "jitter": 0.008, "late_cycles": 0.01},
        {"lost": 0.02, "burst": 3, "mute": 0.05},
        {"lost": 0.05, "every": 4},
        {"lost": 0.05, "period": 0.002, "jitter": 0.004},
        {"lost": 0.05, "period": 0.04},
    ],
)
def test_lost_frames_are_no_delay_once_the_node_was_asked(kind: dict, seed: int) -> None:
    world = World(seed, **kind).run(60.0)
    received = max(now - true for now, _, true in world.looks)  # gaps and late cycles alone make them old
    assert world.oldest() <= max(world.max_age, received + 2 * world.period)
    assert 0 < world.asks <= 60.0 / ASK_PAUSE


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rate", [0.02, 0.1, 0.3])
@pytest.mark.parametrize(
    "kind",
    [
        {},
        {"every": 3},
        {"lost": 0.02},
        {"jitter": 0.008},
        {"answers_after": 1.4},
        {"mute": 1.0},
        {"late_cycles": 0.01},
        {"period": 0.002},
        {"period": 0.05},
        {"lost": 0.02, "burst": 2, "jitter": 0.008, "mute": 0.3},
    ],
)
def test_a_growing_delay_is_detected_before_a_value_counts_as_younger_than_it_is(
    kind: dict, rate: float, seed: int
) -> None:
    world = World(seed, **kind)
    world.run(3.0)
    began = world.now
    world.lag = lambda t: max(0.0, rate * (t - began))
    world.looks.clear()
    world.run(min(30.0, 0.6 / rate))
    bound = (world.every + 2) * world.period + JITTER + world.jitter + 3 * SERVER
    late = 30 * world.period if world.late_cycles else 0.0
    began, doubtful = world.looks[0][0], False
    for now, stated, true in world.looks:
        if stated - true <= bound:
            doubtful = False
            continue
        began, doubtful = (began if doubtful else now), True
        # Within the grace time a value counts as nearly too old, and not as unknown; without an answer, gaps count as lost.
        assert now - stated >= 0.8 * world.max_age or world.mute
        assert now - began <= (LONGEST_ANSWER if world.mute else GRACE) + 3 * world.period + late
    known = [(now, true) for now, stated, true in world.looks if now - stated <= world.max_age]
    assert max(now - true for now, true in known) <= world.max_age + bound + late + rate * (
        GRACE + LONGEST_ANSWER * world.mute
    )
    assert max(now - stated for now, stated, _ in world.looks[-20:]) > 0.3


def test_a_delay_that_ends_no_longer_counts() -> None:
    world = World(1)
    world.run(1.0)
    world.lag = lambda t: max(0.0, min(0.06, 0.1 * (t - 101.0), 0.1 * (103.0 - t)))
    world.run(1.5)
    assert world.lags.late > 0.04
    world.run(3.0)
    assert world.lags.late == 0.0
    (now, stated, true) = world.looks[-1]
    assert now - stated <= 2 * world.period
    assert stated - true <= world.period


def test_a_link_that_was_slow_from_the_beginning_is_detected_by_its_round_trips() -> None:
    world = World(1, lag=lambda _: 0.4)
    world.trips = world.lags._trips = RoundTrips()
    for asked in range(5):
        world.trips.note(asked, asked + SERVER + 0.4)
    world.run(3.0)
    assert all(now - stated >= 0.4 - ALLOWED for now, stated, _ in world.looks if now > 101.0)


def test_counting_begins_when_the_node_is_operational_and_restarts_after_a_loss() -> None:
    world = World(1)
    world.run(1.0)
    assert world.lags.is_known
    (count,) = world.lags.counts
    before = count.offset
    world.slot.frames += 50  # sent while counting was off
    world.lags.look(world.now, False)
    assert not world.lags.is_known
    world.run(1.0)
    assert world.lags.is_known
    assert count.offset < before
    assert world.lags.late == 0.0


def test_a_frame_that_was_sent_before_the_first_sync_belongs_to_no_sync() -> None:
    """Over a slow link, by its round trips: it is not the beginning of the count, the next one is."""
    world = World(1, lag=lambda _: 0.05)
    world.trips = world.lags._trips = RoundTrips()
    world.trips.note(99.0, 99.0 + ALLOWED + 0.05)
    world.cycle()
    world.slot.frames, world.slot.latest = 1, (b"", world.now + 0.01)  # an old one, from before its restart
    world.now += 0.02
    for _ in range(3):
        assert world.lags.look(world.now, True) == [world.slot.latest[1]]
        assert not world.lags.is_known
    world.run(1.0)
    assert world.lags.is_known


@pytest.mark.parametrize(
    "behind", [SyncTimes.KEPT - 1, SyncTimes.KEPT, SyncTimes.KEPT + 1, 3 * SyncTimes.KEPT]
)
def test_frames_later_than_the_stored_sync_times_are_old_and_raise_no_error(behind: int) -> None:
    world = World(1, period=0.001)
    world.run(1.0)
    for _ in range(behind):
        world.now += world.period
        world.syncs.note(world.now)
        world.lags.look(world.now, True)
    for _ in range(20):  # the link delivers the frames that it had queued
        world.now += world.period
        world.syncs.note(world.now)
        world.slot.frames += 1
        world.slot.latest = (b"", world.now)
        (sampled,) = world.lags.look(world.now, True)
        assert sampled < world.now - 0.8 * world.max_age


def test_a_bus_without_our_sync_is_not_counted() -> None:
    slot = SimpleNamespace(frames=0, latest=(b"", 5.0))
    lags = Lags([(slot, 1, 0.1)], 0.01, SyncTimes(), RoundTrips())
    assert lags.is_known
    assert lags.look(9.0, True) == [5.0]
    worker = Worker()
    lags.ask(9.0, True, worker)
    assert not worker.jobs


# Without a count.


def test_two_slow_answers_in_succession_are_a_delay_and_one_is_a_busy_node() -> None:
    trips, lag = RoundTrips(), LinkLag()
    steps = []
    for asked, taken in ((1.0, 0.004), (2.0, 0.9), (3.0, 0.004), (4.0, 0.3), (5.0, 0.2), (6.0, 0.03)):
        trips.note(asked, asked + taken)
        steps += [lag.step(trips), lag.step(trips)]
    assert steps == pytest.approx([0, 0, 0, 0, 0, 0, 0, 0, 0.196, 0.196, 0, 0])


def test_while_answers_become_slower_the_next_request_follows_at_once() -> None:
    trips, lag = RoundTrips(), LinkLag()
    trips.note(0.0, 0.004)
    doubts = []
    for asked, taken in ((1.0, 0.004), (2.0, 0.08), (3.0, 0.25), (4.0, 0.32), (5.0, 0.34), (6.0, 0.004)):
        trips.note(asked, asked + taken)
        lag.step(trips)
        doubts.append(lag.doubtful)
    assert doubts == [False, True, True, True, False, False]


def test_a_node_without_a_count_is_polled_and_its_values_are_as_old_as_its_answers_show() -> None:
    trips = RoundTrips()
    changing, timed = (SimpleNamespace(frames=1, latest=(b"", 10.0)) for _ in range(2))
    lags = Lags([(changing, 0, float("inf")), (timed, 0, 0.35)], 0.01, SyncTimes(), trips)
    asked, worker = [], Worker()
    for number in range(400):
        now = 10.0 + 0.01 * number
        if lags.look_by <= now:
            lags.ask(now, True, worker)
            if worker.jobs:
                asked.append(now)
                worker.jobs.pop().done(0, None)
    assert [later - earlier for earlier, later in itertools.pairwise(asked)] == pytest.approx(
        [ASK_PERIOD] * (len(asked) - 1)
    )
    assert len(asked) == 8
    lags.ask(now + 9.0, False, worker)
    assert not worker.jobs
    trips.note(0.0, 0.004)
    assert lags.look(14.0, True) == [10.0, 10.0]
    for requested_at in (11.0, 12.0):
        trips.note(requested_at, requested_at + 0.204)
        seen = lags.look(14.0, True)
    assert seen == pytest.approx([9.8, 9.8])
    assert lags.late == pytest.approx(0.2)
    for requested_at in (13.0, 14.0):
        trips.note(requested_at, requested_at + LONGEST + 0.1)
        seen = lags.look(15.0, True)
    assert seen[0] == -float("inf")  # silence says nothing of it, so nothing else would end it
    assert seen[1] == pytest.approx(10.0 - LONGEST - 0.096)


def test_the_second_request_follows_a_slow_answer_without_a_pause() -> None:
    """A delay that grows passes for fresh until the second slow answer, so this must not wait for half a second."""
    trips, slot, worker, asked = RoundTrips(), SimpleNamespace(frames=1, latest=(b"", 10.0)), Worker(), []
    lags = Lags([(slot, 0, 0.35)], 0.01, SyncTimes(), trips)
    for number in range(100):
        now = 10.0 + 0.01 * number
        lags.look(now, True)
        if lags.look_by <= now:
            lags.ask(now, True, worker)
        if worker.jobs and now >= 10.0 + 0.1 * (
            len(asked) + 1
        ):  # each answer takes longer than the one before
            asked.append(now)
            trips.note(asked[-1] - 0.1, now)
            worker.jobs.pop().done(0, None)
        if lags.late:
            break
    assert len(asked) == 2
    assert now < 10.0 + ASK_PERIOD


def test_round_trips_exclude_the_allowed_processing_time_of_the_node() -> None:
    trips = RoundTrips()
    assert (trips.delay(), trips.shortest_delay, trips.own_time) == (0.0, 0.0, ALLOWED)
    trips.note(1.0, 1.3)
    assert trips.delay() == pytest.approx(0.3 - ALLOWED)
    assert trips.shortest_delay == pytest.approx(0.3 - ALLOWED)
    trips.note(2.0, 2.01)
    trips.note(3.0, 3.2)
    assert trips.delay() == pytest.approx(0.19)
    assert (trips.shortest_delay, trips.newest) == (0.0, (3.0, 3.2))


def test_the_times_of_syncs_are_those_of_the_newest_thousand() -> None:
    syncs = SyncTimes()
    assert (syncs.count, syncs.time(1), syncs.number_at(5.0)) == (0, -float("inf"), 0)
    for number in range(1, 2001):
        syncs.note(number * 0.5)
    assert (syncs.count, syncs.time(2000), syncs.time(977)) == (2000, 1000.0, 488.5)
    assert (syncs.time(976), syncs.time(2001)) == (-float("inf"), -float("inf"))
    assert [syncs.number_at(at) for at in (1001.0, 1000.0, 999.9, 700.2)] == [2000, 2000, 1999, 1400]


def _slow_server(started: int | None, delay: float) -> list[float]:
    """Return the lags over 2 s. The SDO server needs 0.3 s; each frame comes ``delay`` seconds after its SYNC."""
    syncs, trips = SyncTimes(), RoundTrips()
    trips.note(99.0, 99.3 + delay)
    slot = SimpleNamespace(frames=0, latest=(b"", -1e9))
    lags = Lags([(slot, 1, 0.1)], 0.01, syncs, trips, lambda: started)
    seen = []
    for cycle in range(200):
        now = 100.0 + cycle * 0.01
        syncs.note(now)
        behind = round(delay / 0.01)
        if cycle > behind:
            slot.frames += 1
            slot.latest = (b"", now - 0.007)
        lags.look(now, cycle > 20)
        seen.append(lags.late)
    return seen


def test_a_slow_sdo_server_is_no_delay_of_the_link_if_frames_are_counted_since_the_start_of_the_node():
    assert max(_slow_server(0, 0.0)) == 0.0
    assert max(_slow_server(None, 0.0)) > 0.1  # nothing shows it


def test_a_delay_that_existed_at_the_start_of_the_node_is_known_by_the_frames_since_then():
    assert _slow_server(0, 0.2)[-1] == pytest.approx(0.2, abs=0.011)
