"""Rows of samples as bytes: they are read as written, old blocks are dropped, and the collector has nothing to track."""

from __future__ import annotations

import gc
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.cia402.state import PowerState
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState
from axisbus.record.sample_packing import BLOCK, AxisSample, PackedRows

LONG = st.integers(-(2**63), 2**63 - 1)
samples = st.builds(
    AxisSample,
    st.none() | LONG,
    st.none() | LONG,
    st.none() | LONG,
    st.none() | LONG,
    st.none() | LONG,
    LONG,
    st.none() | st.integers(-128, 127),
    st.none() | st.integers(0, 0xFFFF),
    st.sampled_from(AxisState),
    st.sampled_from(PowerState),
    st.booleans(),
)


def snapshot(sample: AxisSample) -> Snapshot:
    position, velocity, torque, target, demand, origin, mode, word, state, power, homed = sample
    return Snapshot(
        0.0, state, power, word, mode, position, 0.0, demand, velocity, torque, target, origin, homed, True, None
    )  # fmt: skip


PLAIN = AxisSample(1, 2, 3, 4, 5, 6, 7, 0x0237, AxisState.STANDSTILL, PowerState.SWITCHED_ON, True)


@given(st.lists(st.tuples(st.floats(0, 1e9), samples, samples), max_size=20))
def test_rows_are_read_as_written(rows):
    packed = PackedRows(2, 100)
    for now, first, second in rows:
        packed.append(now, [snapshot(first), snapshot(second)])
    assert list(packed) == [(now, [first, second]) for now, first, second in rows]
    assert len(packed) == len(rows)


@pytest.mark.parametrize("rows", [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK, 3 * BLOCK + 1, 10 * BLOCK])
def test_the_newest_are_kept_and_at_most_a_block_beyond_the_limit(rows):
    limit = 2 * BLOCK
    packed = PackedRows(1, limit)
    for number in range(rows):
        packed.append(float(number), [snapshot(PLAIN)])
    times = [now for now, _ in packed]
    assert len(times) == len(packed)
    assert min(rows, limit) <= len(times) <= limit + BLOCK
    assert times == [float(number) for number in range(rows)][-len(times) :] if rows else times == []


def test_without_axes_there_are_times():
    packed = PackedRows(0, 10)
    packed.append(1.5, [])
    assert list(packed) == [(1.5, [])]


def test_the_collector_has_nothing_to_look_at():
    packed = PackedRows(3, 100_000)
    row = [snapshot(PLAIN)] * 3
    packed.append(0.0, row)
    gc.collect()
    before = len(gc.get_objects())
    for number in range(20_000):
        packed.append(float(number), row)
    gc.collect()
    assert len(gc.get_objects()) - before < 20


def test_readers_during_writing_see_whole_rows_in_order():
    packed, seen = PackedRows(1, 2 * BLOCK), []
    done = threading.Event()

    def write() -> None:
        for number in range(8 * BLOCK):
            packed.append(float(number), [snapshot(PLAIN._replace(position=number))])
        done.set()

    writer = threading.Thread(target=write)
    writer.start()
    while not done.is_set():
        seen.append(list(packed))
    writer.join()
    seen.append(list(packed))
    for rows in seen:
        numbers = [int(now) for now, _ in rows]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers))) if numbers else not rows
        assert all(sample.position == int(now) for now, (sample,) in rows)
    assert len(seen[-1]) >= 2 * BLOCK
