"""Feeding trajectories to the core: requested samples are computed in a thread of its own, in order and in turns."""

from __future__ import annotations

import math
import os
import threading
from collections import Counter
from itertools import pairwise

import pytest

from axisbus.core.process.trajectory_feeder import Feeder, Sampler
from axisbus.errors import ArgumentError
from axisbus.interrupt_guard import in_thread_of_ours
from axisbus.motion.moves.remote_trajectory import Streamed
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory

STEP = 0.01


class Line:
    """A linear motion, which notes the requested times."""

    def __init__(self, duration: float = 10.0, fails_at: float = math.inf, gives=None) -> None:
        self.duration = duration
        self.fails_at = fails_at
        self.gives = gives
        self.asked: list[float] = []
        self.threads: set[str] = set()
        self.may_go_on = threading.Event()
        self.may_go_on.set()
        self.is_asked = threading.Event()

    def position(self, t: float) -> float:
        self.threads.add(threading.current_thread().name)
        self.asked.append(t)
        self.is_asked.set()
        self.may_go_on.wait(10)
        if t >= self.fails_at:
            if self.gives is None:
                raise ZeroDivisionError("there is no more")
            return self.gives
        return 2.0 * t


class Sink:
    """The samples that the feeder sends, and a wait for them."""

    def __init__(self) -> None:
        self.chunks: list[tuple[int, int, tuple[float, ...]]] = []
        self.failures: list[tuple[int, Exception]] = []
        self.changed = threading.Condition()
        self.breaks_for: int | None = None

    def send(self, number: int, first: int, positions: tuple[float, ...]) -> None:
        with self.changed:
            if number == self.breaks_for:
                raise OSError("nobody is there")
            self.chunks.append((number, first, positions))
            self.changed.notify_all()

    def send_failure(self, number: int, error: Exception) -> None:
        with self.changed:
            self.failures.append((number, error))
            self.changed.notify_all()

    def samples(self, number: int) -> list[float]:
        """The samples of one trajectory; none is left out and none comes twice."""
        mine = [(first, positions) for which, first, positions in self.chunks if which == number]
        assert all(first + len(positions) == after for (first, positions), (after, _) in pairwise(mine))
        return [position for _, positions in mine for position in positions]

    def wait(self, done) -> None:
        """Wait until ``done()``, also for a change of the feeder after its last sending, which notifies nobody."""
        with self.changed:
            assert any(self.changed.wait_for(done, 0.01) for _ in range(1000))


@pytest.fixture
def sink():
    return Sink()


@pytest.fixture
def feeder(sink):
    feeder = Feeder(sink.send, sink.send_failure)
    yield feeder
    feeder.close()


def added(feeder: Feeder, number: int, trajectory, seconds: float = 0.1):
    """Give a trajectory to the feeder; return its head."""
    sampler = Sampler(trajectory, STEP, "x")
    head = sampler.head(seconds)
    feeder.add(number, sampler)
    return head


# The head.


def test_the_head_is_sampled_at_the_call_and_no_more_of_it():
    line = Line()
    head = Sampler(line, STEP, "x").head(0.1)
    assert head.positions == pytest.approx([0.02 * number for number in range(11)])
    assert len(line.asked) == 11
    assert (head.duration, head.step) == (10.0, STEP)
    assert (head.span, head.top_speed, head.top_acceleration) == (None, None, None)
    assert Sampler(line, STEP, "x").head(-1.0).positions == (0.0,)


def test_the_head_has_the_properties_of_the_trajectory():
    head = Sampler(TrapezoidalTrajectory(1.0, 9.0, 5.0, 50.0), STEP, "x").head(0.0)
    assert (head.span, head.top_speed, head.top_acceleration) == ((1.0, 9.0), 5.0, 50.0)
    head = Sampler(SampledTrajectory([1, 3, 2], 0.5), STEP, "x").head(9.0)
    assert (head.span, head.top_speed, head.top_acceleration) == ((1.0, 3.0), 4.0, None)
    assert head.positions[-1] == 2
    assert len(head.positions) == 101


@pytest.mark.parametrize("gives", [None, math.nan, "far", True])
def test_an_invalid_position_within_the_head_raises_at_the_call(gives):
    with pytest.raises(ArgumentError, match=r"^x: the trajectory returned no position at 0.050 s"):
        Sampler(Line(fails_at=0.05, gives=gives), STEP, "x").head(0.1)


def test_an_invalid_property_of_a_trajectory_raises_at_the_call():
    class Odd(Line):
        span, top_speed = (0.0, 1.0), math.nan

    with pytest.raises(ArgumentError, match="x: the trajectory returned no top_speed"):
        Sampler(Odd(), STEP, "x").head(0.1)
    with pytest.raises(ArgumentError, match="x: the trajectory returned no duration"):
        Sampler(Line(duration="long"), STEP, "x")


# Requests.


def test_requested_samples_are_computed_in_a_thread_of_axisbus(feeder, sink):
    line = Line()
    stream = Streamed(added(feeder, 7, line))
    line.threads.clear()
    first, count = stream.wanted(0.0)
    feeder.request(7, first, count)
    sink.wait(lambda: len(sink.samples(7)) == count)
    for _, begin, positions in sink.chunks:
        stream.feed(begin, positions)
    assert line.threads == {"axisbus trajectories"}
    assert stream.position(0.2) == pytest.approx(0.4)


def test_without_a_request_nothing_is_sampled(feeder, sink):
    line = Line()
    added(feeder, 7, line)
    feeder.request(8, 11, 25)
    assert len(line.asked) == 11
    assert "axisbus trajectories" not in {thread.name for thread in threading.enumerate()}


def test_the_feeder_thread_counts_as_one_of_ours(feeder, sink):
    class Asks(Line):
        def position(self, t: float) -> float:
            ours.append(in_thread_of_ours())
            return t

    ours: list[bool] = []
    added(feeder, 1, Asks())
    feeder.request(1, 11, 1)
    sink.wait(lambda: sink.chunks)
    assert ours == [False] * 11 + [True]


def test_a_repeated_request_is_sent_once_and_nothing_is_sent_after_the_end(feeder, sink):
    added(feeder, 1, Line(duration=0.5))
    for first, count in ((11, 20), (11, 20), (31, 20), (51, 400)):
        feeder.request(1, first, count)
    sink.wait(lambda: len(sink.samples(1)) == 40)
    feeder.request(1, 51, 20)
    assert sink.samples(1)[-1] == 1.0
    sink.wait(lambda: feeder._trajectories == {})  # it is over


def test_several_trajectories_are_served_in_turns(sink):
    """However much one is asked for: the clock says that each turn's time is over at once."""
    feeder = Feeder(sink.send, sink.send_failure, clock=iter(range(10**6)).__next__)
    first = Line()
    first.may_go_on.clear()
    feeder.add(1, Sampler(first, STEP, "x"))
    feeder.request(1, 0, 60)
    assert first.is_asked.wait(10)
    for number in (2, 3):
        feeder.add(number, Sampler(Line(), STEP, "y"))
        feeder.request(number, 0, 60)
    first.may_go_on.set()
    sink.wait(lambda: sum(len(positions) for *_, positions in sink.chunks) == 180)
    feeder.close()
    order = [number for number, *_ in sink.chunks]
    assert Counter(order) == {1: 60, 2: 60, 3: 60}
    assert all({*order[at : at + 3]} == {1, 2, 3} for at in range(0, 180, 3))
    for number in (1, 2, 3):
        assert sink.samples(number) == pytest.approx([0.02 * sample for sample in range(60)])


# Failures.


@pytest.mark.parametrize("gives", [None, math.inf, "far"])
def test_an_exception_of_the_programs_code_is_reported_once_and_ends_its_trajectory_only(feeder, sink, gives):
    added(feeder, 1, Line(fails_at=0.2, gives=gives))
    added(feeder, 2, Line())
    feeder.request(1, 11, 40)
    feeder.request(2, 11, 40)
    sink.wait(lambda: sink.failures and len(sink.samples(2)) == 40)
    feeder.request(1, 51, 40)
    ((number, error),) = sink.failures
    assert number == 1
    assert isinstance(error, ArgumentError)
    assert error.message == "x: the trajectory returned no position at 0.200 s"
    assert isinstance(error.__cause__, ZeroDivisionError) is (gives is None)


def test_if_one_trajectory_cannot_be_sent_the_others_continue(feeder, sink):
    sink.breaks_for = 1
    for number in (1, 2):
        added(feeder, number, Line())
    feeder.request(1, 11, 40)
    feeder.request(2, 11, 40)
    sink.wait(lambda: len(sink.samples(2)) == 40)
    assert 1 not in feeder._trajectories


def test_samples_of_a_dropped_trajectory_are_not_sent(feeder, sink):
    for fails_at in (math.inf, 0.11):
        line = Line(fails_at=fails_at)
        added(feeder, 1, line)
        line.is_asked.clear()
        line.may_go_on.clear()
        feeder.request(1, 11, 5)
        assert line.is_asked.wait(10)
        feeder.drop(1)
        feeder.drop(99)
        line.may_go_on.set()
    added(feeder, 2, Line())
    feeder.request(2, 11, 5)
    sink.wait(lambda: sink.chunks)
    assert {number for number, *_ in sink.chunks} == {2}
    assert sink.failures == []


def test_a_closed_feeder_has_no_thread_and_feeds_nothing(feeder, sink):
    added(feeder, 1, Line())
    feeder.request(1, 11, 5)
    sink.wait(lambda: sink.chunks)
    feeder.close()
    feeder.close()
    assert "axisbus trajectories" not in {thread.name for thread in threading.enumerate()}
    added(feeder, 2, Line())
    feeder.request(2, 11, 5)
    assert {number for number, *_ in sink.chunks} == {1}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="nothing forks here")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_child_sends_nothing_and_does_not_wait_for_an_inherited_lock(feeder, sink):
    added(feeder, 1, Line())
    feeder.request(1, 11, 5)
    sink.wait(lambda: sink.chunks)
    with feeder._changed:  # as the thread might
        child = os.fork()
        if not child:
            feeder.disown()
            feeder.request(1, 16, 5)
            feeder.drop(1)
            feeder.close()
            os._exit(0 if feeder._thread is None and not feeder._trajectories else 1)
    assert os.waitpid(child, 0)[1] == 0
    feeder.request(1, 16, 5)
    sink.wait(lambda: len(sink.samples(1)) == 10)
