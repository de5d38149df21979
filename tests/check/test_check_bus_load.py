"""The length of a frame: against a frame built bit by bit in another way; and the meter's sums and its fullest 100 ms."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.cell import reader
from axisbus.check import bus_load
from axisbus.check.bus_load import Meter, actual_bits
from axisbus.cia301.frame import CanFrame, plain_bits, worst_bits
from axisbus.core.files import load_dictionaries

CELL = Path(__file__).parents[2] / "examples" / "cell.toml"


def _crc_by_division(bits: str) -> str:
    """The remainder of the bits, with 15 zeros behind, divided by 1100010110011001 (ISO 11898-1), as schoolbook division."""
    number, divisor = int(bits, 2) << 15, 0b1100010110011001
    while number.bit_length() >= 16:
        number ^= divisor << (number.bit_length() - 16)
    return f"{number:015b}"


def _stuff_by_text(bits: str) -> str:
    """Stuff from the left, one place after the other, by replacing text."""
    start = 0
    while (found := re.compile("00000|11111").search(bits, start)) is not None:
        other = "1" if found.group()[0] == "0" else "0"
        bits = bits[: found.end()] + other + bits[found.end() :]
        start = found.end()  # the stuff bit may begin a run
    return bits


def _length(frame: CanFrame) -> int:
    control = f"{len(frame.data):04b}"
    if frame.extended:
        number = f"{frame.can_id:029b}"
        head = "0" + number[:11] + "11" + number[11:] + "0" + "00" + control
    else:
        head = "0" + f"{frame.can_id:011b}" + "0" + "0" + "0" + control
    body = head + "".join(f"{octet:08b}" for octet in frame.data)
    # CRC delimiter, acknowledge slot and delimiter, seven bits end of frame, three bits between frames
    return len(_stuff_by_text(body + _crc_by_division(body))) + 1 + 2 + 7 + 3


@given(st.integers(0, 0x7FF), st.binary(max_size=8))
def test_a_frame_has_the_bits_that_it_has(can_id, data):
    frame = CanFrame(0.0, can_id, data)
    assert actual_bits(frame) == _length(frame)
    assert plain_bits(len(data)) <= actual_bits(frame) <= worst_bits(len(data))


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8))
def test_so_has_one_with_a_long_identifier(can_id, data):
    frame = CanFrame(0.0, can_id, data, extended=True)
    assert actual_bits(frame) == _length(frame)
    assert plain_bits(len(data), True) <= actual_bits(frame) <= worst_bits(len(data), True)


@pytest.mark.parametrize(("data_bytes", "plain", "worst"), [(0, 47, 55), (1, 55, 65), (8, 111, 135)])
def test_the_bounds_of_the_literature(data_bytes, plain, worst):
    assert (plain_bits(data_bytes), worst_bits(data_bytes)) == (plain, worst)


def test_the_longest_frame_there_is_has_29_bits_of_identifier():
    assert (plain_bits(8, True), worst_bits(8, True)) == (131, 160)


def test_the_meter_adds_up_by_node_and_kind_and_finds_the_fullest_window():
    meter = Meter(bitrate=10_000)
    burst = [CanFrame(5.0 + n * 0.01, 0x181, bytes(range(8))) for n in range(5)]
    frames = [CanFrame(0.0, 0x080), *burst, CanFrame(10.0, 0x080)]
    for frame in frames:
        meter.add(frame, "SYNC" if frame.can_id == 0x080 else "TPDO", None if frame.can_id == 0x080 else 1)
    meter.add(CanFrame(6.0, 4, error=True), "error frame", None)
    for errors in (0x80, 0x88):  # the counters in it are no other kind
        data = bytes((0, 0x20, 0, 0, 0, 0, errors, 0))
        meter.add(CanFrame(6.1, 0x204, data, error=True), "error frame", None)
    found = meter.result()
    assert found is not None
    assert (found.seconds, found.total.frames, found.error_frames) == (10.0, 7, 3)
    assert found.errors == {"error frame": 1, "transmit errors (passive)": 2}
    assert found.by_node[1].bits == sum(_length(frame) for frame in burst)
    assert found.load(found.total) == sum(_length(frame) for frame in frames) / (10_000 * 10.0)
    # All five of the burst lie in one window of 100 ms, in which 1000 bits have room.
    assert found.peak.load == sum(_length(frame) for frame in burst) / 1000
    assert found.peak.time == pytest.approx(5.04)


def test_no_time_has_no_load():
    meter = Meter(bitrate=10_000)
    assert meter.result() is None
    meter.add(CanFrame(1.0, 0x080), "SYNC", None)
    assert meter.result() is None


def test_the_plan_of_the_example_by_hand():
    """Each 4 ms: SYNC, for each of three drives two RPDOs (7 and 6 bytes), three TPDOs (7, 6 and 4); in 100 ms 4 heartbeats."""
    cell = reader.load(CELL)
    found = bus_load.streams(cell, load_dictionaries(cell))
    assert sum(1 for stream in found if stream.kind == "RPDO") == 6
    per_cycle = 47 + 3 * ((47 + 56) + (47 + 48) + (47 + 56) + (47 + 48) + (47 + 32))
    assert sum(stream.least for stream in found) == pytest.approx(per_cycle / 0.004 + 4 * 55 / 0.1)
    worst = 55 + 3 * ((55 + 70) + (55 + 60) + (55 + 70) + (55 + 60) + (55 + 40))
    assert sum(stream.worst for stream in found) == pytest.approx(worst / 0.004 + 4 * 65 / 0.1)
