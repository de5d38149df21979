"""Recordings: candump's lines typed by hand after can-utils, and every format that python-can writes, read back."""

from __future__ import annotations

import contextlib
import itertools
import struct
import tracemalloc
import zlib
from pathlib import Path

import can
import pytest

from axisbus.bus.link import frame_files
from axisbus.cia301.frame import CanFrame
from axisbus.errors import UserError


@pytest.mark.parametrize(
    ("line", "frame"),
    [
        (
            "(1436509052.249713) vcan0 044#2A366C2BBA",
            CanFrame(1436509052.249713, 0x044, bytes.fromhex("2A366C2BBA")),
        ),
        ("(1436509052.249713) can0 705#00 R", CanFrame(1436509052.249713, 0x705, b"\0")),
        ("(1.000000) can0 705#R", CanFrame(1.0, 0x705, remote=True)),
        ("(1.000000) can0 705#R1", CanFrame(1.0, 0x705, remote=True)),
        ("(1.000000) can0 00000181#01", CanFrame(1.0, 0x181, b"\1", extended=True)),
        (
            "(1.000000) can0 20000004#0008000000000000",
            CanFrame(1.0, 4, bytes.fromhex("0008000000000000"), error=True),
        ),
        (
            "  can0  181   [8]  37 06 01 00 80 00 00 00",
            CanFrame(0.0, 0x181, bytes.fromhex("3706010080000000")),
        ),
        (" (001.500000)  can0  080   [0]", CanFrame(1.5, 0x080)),
        (" (1436509052.249713)  can0  RX - -  705   [1]  05", CanFrame(1436509052.249713, 0x705, b"\5")),
        ("  can0  705   [1]  remote request", CanFrame(0.0, 0x705, remote=True)),
        ("  vcan0  181   [3]  41 42 43   'ABC'", CanFrame(0.0, 0x181, b"ABC")),
        (
            "  can0  20000080   [8]  00 00 00 00 00 00 00 00   ERRORFRAME",
            CanFrame(0.0, 0x80, bytes(8), error=True),
        ),
    ],
)
def test_a_line_of_candump(line, frame):
    found = frame_files.parse(line)
    assert found.channel in ("can0", "vcan0")
    assert found._replace(channel="") == frame


@pytest.mark.parametrize(
    "line",
    [
        "",
        "hello",
        "(1.0) can0 181#0",
        "(1.0) can0 181#112233445566778899",
        "can0 181 [2] 11",
        "(1.0) can0 181##1AABB",
        "[bus]",
    ],
)
def test_an_invalid_line_is_refused(line):
    assert frame_files.parse(line) is None


MESSAGES = [
    can.Message(timestamp=10.0, arbitration_id=0x705, data=b"\0", is_extended_id=False),
    can.Message(timestamp=10.25, arbitration_id=0x181, data=bytes(range(8)), is_extended_id=False),
    can.Message(timestamp=10.5, arbitration_id=0x12345678, data=b"\1", is_extended_id=True),
]


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".csv", ".log", ".trc", ".db"])
def test_every_format_gives_the_same_frames(tmp_path, suffix):
    path = tmp_path / f"run{suffix}"
    with can.Logger(path) as writer:
        for message in MESSAGES:
            writer(message)
    skipped = frame_files.SkippedLines()
    frames = list(frame_files.read(path, skipped))
    assert [(frame.can_id, frame.data, frame.extended) for frame in frames] == [
        (0x705, b"\0", False),
        (0x181, bytes(range(8)), False),
        (0x12345678, b"\1", True),
    ]
    assert frames[1].time - frames[0].time == pytest.approx(0.25, abs=0.002)
    assert skipped.frames == 3


def test_a_torn_last_line_is_counted_not_fatal(tmp_path):
    path = tmp_path / "run.log"
    path.write_text("(1.0) can0 705#00\n(1.1) can0 705#0")
    skipped = frame_files.SkippedLines()
    assert len(list(frame_files.read(path, skipped))) == 1
    assert (skipped.count, skipped.first) == (1, "2: (1.1) can0 705#0")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.blf", None, "there is no recording"),
        ("run.pdf", b"%PDF", "this recording format is not supported"),
        (
            "run.blf",
            b"no blf at all, but long enough to look like the beginning of one" * 3,
            "cannot be read at its beginning",
        ),
        ("run.log", b"", "there is no CAN frame in"),
        ("run.txt", b"some text\n", "there is no CAN frame in"),
    ],
)
def test_a_file_that_is_no_recording_is_one_clear_sentence(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(UserError, match=words):
        list(frame_files.read(tmp_path / name, frame_files.SkippedLines()))


def test_a_size_in_a_blf_that_is_larger_than_the_file_takes_no_memory(tmp_path):
    path = tmp_path / "run.blf"
    with can.BLFWriter(path) as log:
        log.on_message_received(
            can.Message(timestamp=1.0, arbitration_id=0x181, data=b"\1", is_extended_id=False)
        )
    data = path.read_bytes()
    at = data.index(b"LOBJ") + 8  # the size of an object is there
    path.write_bytes(data[:at] + (0x7FFF_FFFF).to_bytes(4, "little") + data[at + 4 :])
    tracemalloc.start()
    with contextlib.suppress(UserError):
        list(frame_files.read(path, frame_files.SkippedLines()))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10_000_000


# -- BLF: objects in containers, typed after the format; every size in it may be wrong ------------------------------------


def blf_object(size: int | None = None, data: bytes = b"\1") -> bytes:
    """Return an object with a frame of 181h; ``size`` is given instead of its own."""
    frame = struct.pack("<HBBL8s", 1, 0, len(data), 0x181, data)
    rest = struct.pack("<LHHQ", 2, 0, 0, 0) + frame
    return struct.pack("<4sHHLL", b"LOBJ", 32, 1, 16 + len(rest) if size is None else size, 1) + rest


def blf_file(path: Path, *containers: bytes, method: int = 2) -> Path:
    """Write a file with these containers, each with so many bytes of objects."""
    with can.BLFWriter(path):
        pass
    data = bytearray(path.read_bytes()[:144])
    for content in containers:
        packed = zlib.compress(content) if method == 2 else content
        head = struct.pack("<H6xL4x", method, len(content))
        size = 16 + len(head) + len(packed)
        data += struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10) + head + packed + bytes(size % 4)
    path.write_bytes(data)
    return path


def blf_frames(path: Path, most: int = 1000) -> list[CanFrame]:
    return list(itertools.islice(frame_files.read(path, frame_files.SkippedLines()), most))


@pytest.mark.parametrize("method", [0, 2])
def test_a_blf_object_may_continue_in_the_next_container(tmp_path, method):
    objects = b"".join(blf_object(data=bytes([number])) for number in range(100))
    parts = [objects[at : at + 70] for at in range(0, len(objects), 70)]
    found = blf_frames(blf_file(tmp_path / "run.blf", *parts, method=method))
    assert [frame.data for frame in found] == [bytes([number]) for number in range(100)]


@pytest.mark.timeout(20)
@pytest.mark.parametrize("size", [0, 1, 15])
@pytest.mark.parametrize("body", [blf_object(), bytes(32)], ids=["objects", "zeros"])
def test_an_object_of_a_blf_that_is_shorter_than_its_header_ends_the_reading(tmp_path, size, body):
    """Read by its size, it would be read again and again."""
    wrong = blf_object(size)[:16] + body
    with pytest.raises(UserError, match=r"run\.blf cannot be read after 2 frames") as caught:
        blf_frames(blf_file(tmp_path / "run.blf", blf_object() * 2 + wrong + blf_object()))
    assert "shorter than its header" in caught.value.observed


def test_a_container_of_a_blf_that_decompresses_to_hundreds_of_mb_is_refused_before_it_does(tmp_path):
    path = blf_file(tmp_path / "run.blf", blf_object() + bytes(200_000_000))
    tracemalloc.start()
    with pytest.raises(UserError, match="cannot be read at its beginning") as caught:
        blf_frames(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert caught.value.observed == "ValueError: a container has more than 16 MB"
    assert peak < 70_000_000


def test_an_object_of_a_blf_that_never_ends_is_not_stored_without_end(tmp_path):
    path = blf_file(tmp_path / "run.blf", blf_object(), blf_object(0xFFFF_FFFF), *[bytes(1 << 20)] * 100)
    tracemalloc.start()
    with pytest.raises(UserError, match="cannot be read after 1 frame") as caught:
        blf_frames(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert caught.value.observed == "ValueError: an object is larger than 4 MB"
    assert peak < 30_000_000


@pytest.mark.parametrize("method", [0, 2])
def test_the_frames_of_a_blf_that_is_cut_are_read_and_its_end_is_reported(tmp_path, method):
    objects = b"".join(blf_object(data=bytes([number])) for number in range(100))
    path = blf_file(tmp_path / "run.blf", objects, objects, method=method)
    whole = path.read_bytes()
    for cut in (1, 2, 30, 31, 48, 100):
        path.write_bytes(whole[:-cut])
        found = []
        with pytest.raises(UserError, match="cannot be read after") as caught:
            found.extend(frame_files.read(path, frame_files.SkippedLines()))
        assert 100 <= len(found) < 200 or cut <= 4  # the end of the compressed data holds no frame
        assert [frame.data[0] for frame in found] == [number % 100 for number in range(len(found))]
        assert "ends in the middle of an object" in caught.value.observed


def test_an_object_of_a_blf_that_is_longer_than_the_rest_of_the_file_is_reported(tmp_path):
    found = []
    with pytest.raises(UserError, match="cannot be read after 2 frames") as caught:
        found.extend(
            frame_files.read(
                blf_file(tmp_path / "run.blf", blf_object() * 2 + blf_object(5000) + blf_object()),
                frame_files.SkippedLines(),
            )
        )
    assert "the size of an object is wrong" in caught.value.observed


def test_an_unknown_compression_of_a_blf_is_reported(tmp_path):
    with pytest.raises(UserError, match="cannot be read at its beginning") as caught:
        blf_frames(blf_file(tmp_path / "run.blf", blf_object(), method=7))
    assert "compression 7" in caught.value.observed


ASC_HEAD = "date Mon Dec 6 11:21:13 am 2021\nbase hex  timestamps absolute\n"
ASC_FRAMES = "   0.010000 1  081             Rx   d 1 10\n   0.020000 2  701             Rx   d 1 05\n"


def read(path, channel=None):
    skipped = frame_files.SkippedLines()
    return list(frame_files.read(path, skipped, channel)), skipped


@pytest.mark.parametrize(
    "head",
    [
        "",
        ASC_HEAD,
        ASC_HEAD + "// version 7.1.0\n",
        ASC_HEAD + "no internal events logged\n",
        ASC_HEAD + "internal events logged\n\n",
        ASC_HEAD + "Begin Triggerblock Mon Dec 6 11:21:13 am 2021\n   0.000000 Start of measurement\n",
    ],
)
def test_no_frame_of_an_asc_is_lost_however_its_head_ends(tmp_path, head):
    path = tmp_path / "run.asc"
    path.write_text(head + ASC_FRAMES + "End TriggerBlock\n")
    frames, skipped = read(path)
    assert [(frame.can_id, frame.channel) for frame in frames] == [(0x081, "1"), (0x701, "2")]
    assert skipped.count == 0


def test_events_of_an_asc_that_are_no_frames_are_counted(tmp_path):
    path = tmp_path / "run.asc"
    path.write_text(ASC_HEAD + ASC_FRAMES + "   0.03 1  Statistic: D 0 R 0\n" + ASC_FRAMES)
    frames, skipped = read(path)
    assert len(frames) == 4
    assert (skipped.count, skipped.first) == (1, "5: 0.03 1  Statistic: D 0 R 0")


def test_bus_errors_and_states_of_a_trc_are_counted(tmp_path):
    path = tmp_path / "run.trc"
    path.write_text(
        ";$FILEVERSION=2.1\n;$STARTTIME=44537.4741203704\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n;\n"
        "     1      1059.900 DT 1      0701 Rx -  1    05\n"
        "     2      1302.945 ST 1         - Rx -  4    00 00 00 08\n"
        "     3      1323.045 ER 1         - Rx -  5    04 00 02 00 00\n"
    )
    frames, skipped = read(path)
    assert len(frames) == 1
    assert (skipped.count, skipped.first[:10]) == (2, "6: 2      ")


def test_a_line_that_cannot_be_read_is_named(tmp_path):
    path = tmp_path / "run.asc"
    path.write_text(ASC_HEAD + ASC_FRAMES + "   0.030000 1  081             Rx   d 1 zz\n")
    with pytest.raises(UserError, match="after 2 frames, in line 5"):
        read(path)


TWO = "(1.0) can0 701#05\n(1.1) can1 702#05\n(1.2) can0 701#05\n"


def test_the_frames_of_one_bus_are_chosen_by_its_name(tmp_path):
    path = tmp_path / "run.log"
    path.write_text(TWO)
    frames, skipped = read(path, "can1")
    assert [frame.can_id for frame in frames] == [0x702]
    assert skipped.channels == {"can0": 2, "can1": 1}
    with pytest.raises(UserError, match="no frame of channel 'can7'") as told:
        read(path, "can7")
    assert told.value.observed == "there are can0, can1"


def test_channels_are_named_as_the_file_has_them(tmp_path):
    for suffix in (".asc", ".blf", ".trc"):
        path = tmp_path / f"run{suffix}"
        with can.Logger(path) as writer:
            for message in MESSAGES:
                writer(can.Message(**{**vars_of(message), "channel": 1}))
        assert {frame.channel for frame in read(path)[0]} == {"2"}, suffix


def vars_of(message):
    names = ("timestamp", "arbitration_id", "data", "is_extended_id")
    return {name: getattr(message, name) for name in names}


def test_times_that_go_back_are_counted_by_bus(tmp_path):
    path = tmp_path / "run.log"
    path.write_text(TWO + "(0.9) can1 702#05\n(1.3) can0 701#05\n")
    assert read(path)[1].times_back == 1
