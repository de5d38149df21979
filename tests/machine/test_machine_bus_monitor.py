"""The overview that a listener makes of a bus: for any frames it can be printed as lines and as JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cell import reader
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.nmt import NmtState
from axisbus.cli.monitor import listen
from axisbus.core.files import load_dictionaries
from axisbus.machine.bus_monitor import BusMonitor

CELL = reader.load(Path(__file__).parents[2] / "examples" / "cell.toml")
FILES = load_dictionaries(CELL)


def heard(*frames: CanFrame) -> BusMonitor:
    overview = BusMonitor(CELL, FILES)
    for frame in frames:
        overview.feed(frame, 1000.0 + frame.time)
    return overview


COB_IDS = st.sampled_from(
    [0, 0x80, 0x81, 0x100, 0x181, 0x201, 0x381, 0x581, 0x601, 0x701, 0x77F, 0x7E4, 0x7E5]
)
FRAMES = st.builds(
    CanFrame,
    st.floats(0, 10),
    COB_IDS | st.integers(0, 0x7FF) | st.integers(0, 0x1FFF_FFFF),
    st.binary(max_size=8),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(FRAMES, max_size=120))
def test_any_frames_can_be_reported(frames: list[CanFrame]) -> None:
    overview = heard(*frames)
    assert overview.frames == len(frames)
    json.dumps(listen._plain(overview, 0.0, 1010.0), allow_nan=False)
    for frame in frames:
        overview.feed(frame, 1010.0)
    assert len(listen.lines(overview, 0.0, 1010.0)) >= 1 + len(CELL.nodes)
    assert overview.take_news() == []


def test_the_periods_are_those_of_the_adapters_times() -> None:
    overview = heard(*(CanFrame(tick * 0.004, 0x80) for tick in range(10)), CanFrame(0.05, 0x701, b"\x05"))
    assert overview.sync.intervals == pytest.approx((0.004, 0.004, 0.004))
    assert overview.nodes[1].beat.intervals is None
    assert overview.nodes[1].state is NmtState.OPERATIONAL
    assert overview.nodes[2].state is None


def test_a_boot_up_begins_the_heartbeats_again() -> None:
    beats = [CanFrame(0.1 * tick, 0x701, b"\x05") for tick in range(4)]
    overview = heard(
        *beats, CanFrame(5.0, 0x701, b"\0"), CanFrame(5.1, 0x701, b"\x7f"), CanFrame(5.2, 0x701, b"\x7f")
    )
    assert overview.nodes[1].state is NmtState.PRE_OPERATIONAL
    assert overview.nodes[1].beat.intervals == pytest.approx((0.1, 0.1, 0.1))
    assert [one.kind.value for one in overview.take_news()] == ["boot-up"]


def test_the_newest_of_a_pdo_replaces_the_one_before() -> None:
    overview = heard(*(CanFrame(0.01 * count, 0x181, bytes(8)) for count in range(3)))
    (newest,) = overview.nodes[1].newest.values()
    assert newest.count == 3
    assert newest.taken == pytest.approx(1000.02)


def test_news_that_are_too_many_are_counted() -> None:
    overview = heard(
        *(CanFrame(0.01 * count, 0x081, bytes.fromhex("2043080000000000")) for count in range(70))
    )
    told = listen.lines(overview, 70.0, 1001.0)
    assert sum("EMCY" in line for line in told) == 5
    assert "65 more are not shown" in told[-1]
    assert not any("not shown" in line for line in listen.lines(overview, 0.0, 1002.0))


def test_a_flood_of_one_node_does_not_hide_the_messages_of_another() -> None:
    storm = [CanFrame(0.001 * count, 0x081, bytes.fromhex("2043080000000000")) for count in range(500)]
    overview = heard(CanFrame(0.0, 0x702, b"\0"), *storm)
    told = listen.lines(overview, 500.0, 1001.0)
    assert any("!! 2 boot-up" in line for line in told) or any("2 y boot-up" in line for line in told)


def test_protocol_violations_are_counted_by_service_and_node() -> None:
    short, emcy = CanFrame(0.0, 0x181, b"\x37"), CanFrame(0.1, 0x085, b"\x20\x43\x08")
    overview = heard(short, short, short, emcy)
    assert overview.tally.words() == "against the protocol: 1 EMCY (node 5), 3 TPDO (node 1)"
    assert overview.tally.plain()[1] == {"kind": "TPDO", "node": 1, "count": 3}
