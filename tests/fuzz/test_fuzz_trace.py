"""Recordings and their decoder: any line, any frame, any order; each frame can be written out, and nothing raises."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.bus.link import controller, frame_files
from axisbus.cell import reader
from axisbus.check.bus_load import Meter
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.master_detection import ExpectedMasters, MasterDetector, words
from axisbus.core.files import load_dictionaries
from axisbus.eds import builtin, load
from axisbus.machine.bus_monitor import BusMonitor
from axisbus.trace import context, frame_formats
from axisbus.trace.decoder import Decoder
from kit import fuzz_frames as fuzz

CELL = reader.load(Path(__file__).parents[2] / "examples" / "cell.toml")
FILES = load_dictionaries(CELL)
KNOWN = {
    "nothing": context.NOTHING,
    "an EDS": context.of_eds({fuzz.NODE: load(builtin.resolve("builtin:gim6010-8", Path()))}),
    "a cell": context.of_cell(CELL, FILES),
}

# -- frames ------------------------------------------------------------------------------------------------------------

nodes = st.sampled_from([1, 2, fuzz.NODE])
bases = st.sampled_from(
    [0x000, 0x080, 0x100, 0x180, 0x200, 0x280, 0x300, 0x380, 0x400, 0x480, 0x500, 0x580, 0x600, 0x700]
)
identifiers = st.one_of(
    st.builds(lambda base, node: base + node, bases, nodes),
    st.sampled_from([0x000, 0x080, 0x100, 0x7E4, 0x7E5, 0x7FF]),
    st.integers(0, 0x7FF),
)
times = st.floats(0, 1e18) | st.sampled_from([0.0, 1.0, 1.001])


def requests(mutate: bool = True) -> st.SearchStrategy[bytes]:
    """SDO requests to the objects that the decoder learns from (PDO parameters, identifiers), and any others."""
    index = st.sampled_from(
        [
            0x1005,
            0x1014,
            0x1200,
            0x1201,
            0x127F,
            0x1400,
            0x1600,
            0x1800,
            0x1A00,
            0x1BFF,
            0x6040,
            0x6060,
            0x6061,
            0x6064,
        ]
    ) | st.integers(0, 0xFFFF)
    frame = st.builds(
        lambda command, index, sub, value: (
            bytes([command]) + fuzz.multiplexer(index, sub) + value.to_bytes(4, "little")
        ),
        st.sampled_from(
            [
                0x23,
                0x2B,
                0x2F,
                0x21,
                0x22,
                0x40,
                0x60,
                0x70,
                0xA0,
                0xA3,
                0xA2,
                0xA1,
                0xC2,
                0xC6,
                0xC1,
                0x80,
                0x01,
            ]
        ),
        index,
        st.integers(0, 9) | st.integers(0, 255),
        fuzz.numbers32
        | st.sampled_from([0x6041_0010, 0x6064_0020, 0x6041_00FF, 0x4000_0185, 0xFF, 0xFE, 2, 3]),
    )
    return fuzz.mutated(frame) if mutate else frame


bytes_of_frames = st.one_of(fuzz.any_bytes, fuzz.sdo_answers, requests())
loose = st.builds(
    CanFrame,
    times,
    identifiers | st.integers(0, (1 << 29) - 1),
    bytes_of_frames,
    st.booleans(),
    st.booleans(),
    st.booleans(),
)
fitting = st.builds(CanFrame, times, identifiers, bytes_of_frames)


@st.composite
def exchanges(draw: st.DrawFn) -> list[CanFrame]:
    """A request, and an answer to the same object."""
    node, time = draw(nodes), draw(st.floats(0, 1e6))
    asked = draw(requests(mutate=False))
    answer = draw(fuzz.whole_answers)
    kept = asked[1:4] if draw(st.booleans()) else answer[1:4]
    return [CanFrame(time, 0x600 + node, asked), CanFrame(time, 0x580 + node, answer[:1] + kept + answer[4:])]


streams = st.lists(
    st.one_of(loose.map(lambda each: [each]), fitting.map(lambda each: [each]), exchanges()), max_size=25
).map(lambda parts: [frame for part in parts for frame in part])


@pytest.mark.parametrize("what", KNOWN)
@given(frames=streams)
@settings(max_examples=60)
def test_every_frame_is_decoded_and_written_out(what, frames):
    decoder = Decoder(KNOWN[what])
    for frame in frames:
        one = decoder.feed(frame)
        assert one.frame is frame
        assert "\n" not in frame_formats.line(one)
        json.dumps(frame_formats.plain(one), allow_nan=False)


@given(frames=streams)
@settings(max_examples=50)
def test_the_overview_and_the_meter_take_every_frame(frames):
    from axisbus.cli.monitor import listen

    overview, meter = BusMonitor(CELL, FILES), Meter(1_000_000)
    for number, frame in enumerate(frames):
        overview.feed(frame, number * 0.01)
        meter.add(frame, "SDO", None)
    json.dumps(listen._plain(overview, 1.0, 1.0), allow_nan=False)
    assert all("\n" not in line for line in listen.lines(overview, 1.0, 1.0))
    found = meter.result()
    assert found is None or found.peak.load >= 0.0


@given(st.lists(loose, max_size=30))
@settings(max_examples=50)
def test_any_frames_may_be_a_sign_of_a_master_and_are_reported_in_words(frames):
    signs = MasterDetector(ExpectedMasters(frozenset({1, 2}), frozenset({127})))
    for frame in frames:
        signs.note(frame)
    assert all(words(signs.heard))
    assert sum(one.count for one in signs.heard) <= len(frames)


@given(st.integers(0, 0x1FFF_FFFF), fuzz.long_bytes)
def test_any_error_frame_has_a_meaning(error_class, data):
    assert controller.describe(error_class, data)
    assert controller.kind(error_class, data)
    controller.condition(error_class, data)


# -- recordings --------------------------------------------------------------------------------------------------------

GOOD = [
    "(1436509052.249713) vcan0 044#2A366C2BBA",
    "(1436509052.249713) vcan0 1F334455#112233 R",
    "(1436509052.249713) can0 581#R8",
    " (2026-01-01 10:00:00.000000)  can0  RX - -  123   [3]  11 22 33",
    "  vcan0  123   [3]  11 22 33   '.\"3'",
    "  can0  123   [0]  remote request",
    "  can0  20000080   [8]  00 00 00 00 00 00 60 00   ERRORFRAME",
    " (000.100000)  can0  2000008   [8]  ERRORFRAME 00 01",
]


@st.composite
def lines(draw: st.DrawFn) -> str:
    line = draw(st.sampled_from(GOOD))
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, len(line)))
        how = draw(st.sampled_from(["cut", "put", "double"]))
        if how == "cut":
            line = line[:at] + line[at + draw(st.integers(1, 4)) :]
        elif how == "put":
            line = (
                line[:at]
                + draw(st.text(alphabet="0123456789ABCDEFabcdef#R[]()-:. \t\0\x1b²٣", max_size=5))
                + line[at:]
            )
        else:
            line = line[:at] + line[at : at + 8] * 2 + line[at + 8 :]
    return line


@given(lines() | st.text(max_size=200))
@settings(max_examples=400)
def test_any_line_of_candump_is_a_frame_or_is_skipped(line):
    frame = frame_files.parse(line)
    if frame is not None:
        assert len(frame.data) <= 8
        assert frame.can_id <= (0x1FFF_FFFF if frame.extended or frame.error else 0x7FF)
        assert frame.time == frame.time  # no NaN
        assert abs(frame.time) != float("inf")


@pytest.mark.parametrize(
    "line",
    [
        f"({'9' * 400}.0) can0 123#00",
        f" ({'9' * 400})  can0  123  [1]  00",
        "  (0001-01-01 00:00:00.000000)  can0  123   [1]  11",
        "  (9999-12-31 23:59:59.999999)  can0  123   [1]  11",
        "(1.0) can0 FFF#00",
        "  can0  800   [1]  11",
    ],
)
def test_an_impossible_time_or_identifier_makes_no_frame(line):
    frame = frame_files.parse(line)
    assert frame is None or (abs(frame.time) < 1e12 and frame.can_id <= 0x7FF)


LONG = {
    "digits": "(" + "1" * 50_000,
    "spaces": "can0 " + " " * 50_000 + "[",
    "bytes": "can0  123  [8]  " + "11 " * 60_000 + "\nx",
}


@pytest.mark.parametrize("line", LONG.values(), ids=LONG)
def test_a_long_line_costs_no_more_than_its_length(line):
    with fuzz.within(2.0):
        assert frame_files.parse(line) is None


@given(st.lists(lines(), max_size=20))
@settings(max_examples=60)
def test_every_line_is_a_frame_or_is_counted(found):
    skipped = frame_files.SkippedLines()
    frames = list(frame_files.lines(found, skipped))
    blank = sum(not line.strip() for line in found)
    assert len(frames) + skipped.count + blank == len(found)
    assert bool(skipped.first) is bool(skipped.count)


def test_a_recording_whose_times_are_not_numbers_is_read(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(
        "timestamp,arbitration_id,extended,remote,error,dlc,data\n"
        "nan,0x181,0,0,0,1,AA==\ninf,0x181,0,0,0,1,AA==\n1e18,0x181,0,0,0,1,AA==\n"
    )
    meter = Meter(1_000_000)
    for frame in frame_files.read(path, frame_files.SkippedLines()):
        meter.add(frame, "TPDO", 1)
        json.dumps(frame_formats.plain(Decoder().feed(frame)), allow_nan=False)
    assert meter.total.frames == 3


@pytest.mark.parametrize("error", [ValueError, OverflowError, OSError])
def test_a_date_that_this_computer_cannot_count_is_no_time(monkeypatch, error):
    class Calendar:
        @staticmethod
        def fromisoformat(_: str) -> None:
            raise error

    monkeypatch.setattr(frame_files, "datetime", Calendar)
    frame = frame_files.parse("  (0001-01-01 00:00:00.000000)  can0  123   [1]  11")
    assert frame is not None
    assert (frame.time, frame.data) == (0.0, b"\x11")
