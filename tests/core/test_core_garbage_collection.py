"""Python's collector in a core: it runs where a cycle leaves time for it, and nowhere else."""

import gc
import time

import pytest

from axisbus.core.realtime_setup import IdleCollector

DUE = gc.get_threshold()
PERIOD = 1.0


@pytest.fixture
def collector(monkeypatch):
    """One whose collections take as long as ``took`` says, by generation; ``ran`` has those that were done."""
    made = IdleCollector(PERIOD)
    made.counts, made.took, made.ran, made.clock = [0, 0, 0], [0.0] * 3, [], 100.0

    def collect(generation):
        made.ran.append(generation)
        made.clock += made.took[generation]

    monkeypatch.setattr(gc, "get_count", lambda: tuple(made.counts))
    monkeypatch.setattr(gc, "collect", collect)
    monkeypatch.setattr(time, "monotonic", lambda: made.clock)
    yield made
    gc.enable()


def cycle(collector, spent=0.0):
    """Let a cycle end that has taken ``spent`` seconds so far; return the generations collected in it."""
    began = collector.clock
    collector.clock += spent
    collector.ran.clear()
    collector.after_cycle(began)
    collector.clock = began + PERIOD
    return list(collector.ran)


def test_automatic_collection_is_off(collector):
    assert not gc.isenabled()


def test_no_collection_before_it_is_due(collector):
    collector.counts = list(DUE)
    assert cycle(collector) == []


@pytest.mark.parametrize("oldest", range(3))
def test_the_oldest_generation_that_is_due_is_collected(collector, oldest):
    collector.counts = [due + 1 if generation <= oldest else 0 for generation, due in enumerate(DUE)]
    assert cycle(collector) == [oldest]


def test_a_collection_too_long_for_the_rest_of_the_cycle_waits_and_one_of_a_younger_generation_runs(
    collector,
):
    collector.counts = [due + 1 for due in DUE]
    collector.took = [0.0, 0.0, 0.3]
    assert cycle(collector) == [2]
    assert cycle(collector, spent=0.25) == [1]
    assert cycle(collector) == [2]  # three times as long is left


def test_if_no_collection_fits_none_runs_until_there_is_far_too_much_garbage(collector):
    collector.counts = [DUE[0] + 1, 0, 0]
    collector.took = [0.4, 0.0, 0.0]
    assert cycle(collector) == [0]
    assert cycle(collector) == []
    collector.counts = [101 * DUE[0], 0, 0]
    assert cycle(collector) == [0]


def test_an_interrupted_collection_runs_again_later(collector):
    collector.counts = [DUE[0] + 1, 0, 0]
    collector.took = [0.4, 0.0, 0.0]
    assert cycle(collector) == [0]
    idle = 0
    while not cycle(collector):
        idle += 1
    assert 15 < idle < 25  # 0.4 to 0.333 s, by a hundredth each time
