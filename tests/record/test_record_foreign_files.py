"""Recordings that are not ours, or damaged: each is read as far as it goes or refused with a sentence, within memory and time."""

from __future__ import annotations

import errno
import io
import json
import random
import struct
import tracemalloc
from pathlib import Path

import pytest

from axisbus import Machine
from axisbus.errors import UserError
from axisbus.record import fault_file
from axisbus.record.columns import NAMES, AxisForm
from axisbus.record.export import write_csv
from axisbus.record.load import load
from axisbus.record.recording_data import RecordedEvent
from axisbus.record.sample_packing import RowForm
from kit.byte_mutations import mutated
from kit.command_line import ROOT

mcap_reader = pytest.importorskip("mcap.reader")
zstandard = pytest.importorskip("zstandard")
from mcap.writer import CompressionType, Writer  # noqa: E402

CELL = ROOT / "examples" / "cell.toml"
BEGAN = {"began_monotonic_ns": "1000000000", "began_ns": "1700000000000000000"}
MAGIC = b"\x89MCAP0\r\n"
MB = 1 << 20


def typed(*names, **types):
    return {
        "properties": {
            **{name: {"type": "number"} for name in names},
            **{k: {"type": t} for k, t in types.items()},
        }
    }


AXIS = typed(*NAMES[:6], state="string")
SAMPLE = {"position": 1.0, "state": "Standstill"}


def write(path, messages, *, schema=AXIS, topic="axis/x", metadata=BEGAN, encoding="jsonschema", **how):
    """Write an MCAP file of one channel."""
    with path.open("wb") as file:
        writer = Writer(file, **how)
        writer.start("x", "x")
        if metadata is not None:
            writer.add_metadata("axisbus", metadata)
        text = schema if isinstance(schema, bytes) else json.dumps(schema).encode()
        channel = writer.register_channel(topic, "json", writer.register_schema("a", encoding, text))
        for number, message in enumerate(messages):
            data = message if isinstance(message, bytes) else json.dumps(message).encode()
            writer.add_message(channel, number, data, 2_000_000_000 + number)
        writer.finish()
    return path


def test_a_channel_of_another_program_in_our_format_is_read(tmp_path):
    run = load(write(tmp_path / "a.mcap", [SAMPLE]))
    assert (list(run.tracks["x"].columns["position"]), run.lacks) == ([1.0], "")


def test_an_object_keeps_the_types_of_its_values(tmp_path):
    values = [True, 1, 1.0, "1"]
    run = load(
        write(
            tmp_path / "a.mcap",
            [{"value": value} for value in values],
            topic="object/a",
            schema=typed("value"),
        )
    )
    assert [(type(value), value) for value in run.objects["a"].columns["value"]] == [
        (type(v), v) for v in values
    ]


@pytest.mark.parametrize(
    ("how", "said"),
    [
        (
            {"encoding": "ros2msg", "schema": b"string data\n", "metadata": None, "topic": "chatter"},
            "no metadata",
        ),
        ({"metadata": {}}, "when it began"),
        ({"metadata": {**BEGAN, "began_ns": "9" * 30}}, "out of range"),
        ({"metadata": {**BEGAN, "began_monotonic_ns": "soon"}}, "when it began"),
        ({"schema": b"no JSON"}, "schema of its channel 'axis/x'"),
        ({"schema": b"[" * 100_000}, "schema of its channel 'axis/x'"),
        ({"schema": {"properties": {"position": 3}}}, "schema of its channel 'axis/x'"),
        ({"schema": typed("position", state="string")}, "no number 'velocity'"),
        ({"schema": typed(*(f"v{n}" for n in range(300)))}, "has 300 values"),
        ({"topic": "object/x", "schema": {}}, "'value'"),
        ({"messages": [SAMPLE, [1]]}, "message 2, of channel 'axis/x'"),
        ({"messages": [{"position": "x"}]}, "message 1, of channel 'axis/x'"),
        ({"messages": [{"position": 1e300, "state": 3}]}, "message 1"),
        ({"messages": [b"\0"]}, "message 1"),
        ({"messages": [b"[" * 100_000]}, "message 1"),
        ({"messages": [b'{"z":' + b"[" * 100_000]}, "message 1"),
        ({"topic": "object/x", "schema": typed("value"), "messages": [{"value": 1 << 64}]}, "over 64 bits"),
        ({"topic": "object/x", "schema": typed("value"), "messages": [{"value": {}}]}, "message 1"),
        ({"topic": "events/nmt", "messages": [{"where": "x"}]}, "message 1, of channel 'events/nmt'"),
    ],
)
def test_a_recording_of_another_format_is_refused_and_named(tmp_path, how, said):
    path = write(tmp_path / "a.mcap", **{"messages": [SAMPLE], **how})
    with pytest.raises(UserError, match="is not a recording of axisbus") as told:
        load(path)
    assert str(path) in told.value.message
    assert said in told.value.observed
    assert told.value.remedy


def record(kind: int, data: bytes) -> bytes:
    return bytes([kind]) + struct.pack("<Q", len(data)) + data


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def with_chunk(size: int, compression: str, data: bytes) -> bytes:
    """Return a file of one chunk that says to have ``size`` octets."""
    pairs = b"".join(text(each) for pair in BEGAN.items() for each in pair)
    metadata = record(12, text("axisbus") + struct.pack("<I", len(pairs)) + pairs)
    chunk = record(
        6, struct.pack("<QQQI", 0, 0, size, 0) + text(compression) + struct.pack("<Q", len(data)) + data
    )
    return MAGIC + record(1, text("") + text("")) + metadata + chunk + record(15, bytes(4)) + MAGIC


def small(size: int, *, said: bool) -> bytes:
    """Return so many zeros, made small; ``said``: with their number."""
    out = io.BytesIO()
    with zstandard.ZstdCompressor().stream_writer(out, closefd=False, size=size if said else -1) as writer:
        for _ in range(size // MB):
            writer.write(bytes(MB))
    return out.getvalue()


def read_within(path: Path) -> tuple[str, int]:
    """Read a file; return why it is not whole, or not read, and the octets of memory that it took."""
    tracemalloc.start()
    try:
        found = load(path).lacks
    except UserError as error:
        found = error.observed
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return found, most


@pytest.mark.parametrize(
    ("size", "frame", "said", "expected"),
    [
        (1024 * MB, 1024 * MB, True, "times as many in memory"),
        (1024 * MB, 1024 * MB, False, "times as many in memory"),
        (MB, 1024 * MB, True, "not the size"),
        (MB, 1024 * MB, False, "not the size"),
        (2**63, MB, True, "times as many in memory"),
    ],
)
def test_data_that_become_large_when_decompressed_are_refused(tmp_path, size, frame, said, expected):
    path = tmp_path / "a.mcap"
    path.write_bytes(with_chunk(size, "zstd", small(frame, said=said)))
    found, most = read_within(path)
    assert expected in found
    assert most < 30 * MB + 512 * path.stat().st_size


def test_a_message_of_few_octets_cannot_become_many_values(tmp_path):
    schema = typed(*NAMES[:6], *(f"v{n}" for n in range(200)), state="string")
    path = write(tmp_path / "a.mcap", [b"{}"] * 5_000, schema=schema)
    assert read_within(path)[1] < 30 * MB + 512 * path.stat().st_size


@pytest.mark.parametrize("compression", ["zstd", "lz4", "", "snappy"])
def test_a_damaged_chunk_ends_the_reading_and_is_reported(tmp_path, compression):
    path = tmp_path / "a.mcap"
    path.write_bytes(with_chunk(100, compression, b"nothing of the kind"))
    assert "is damaged before octet" in load(path).lacks


@pytest.fixture(scope="module")
def variants(tmp_path_factory) -> list[bytes]:
    """A short recording, as we write it, and as others write it again: without checksums, so that damage is not found."""
    folder = tmp_path_factory.mktemp("variants")
    with Machine.simulated(CELL) as cell, cell.recording(folder / "run.mcap", objects=["x:6074", "x:1008"]):
        cell["x"].enable().wait()
    ways = [
        {"compression": CompressionType.NONE},
        {"compression": CompressionType.LZ4},
        {"compression": CompressionType.ZSTD},
        {"use_chunking": False},
    ]
    found = [folder / "run.mcap"]
    for number, way in enumerate(ways):
        found.append(folder / f"{number}.mcap")
        again(folder / "run.mcap", found[-1], **way)
    assert all(load(path).lacks == "" for path in found)
    return [path.read_bytes() for path in found]


def again(source: Path, target: Path, **how: object) -> None:
    """Write the first messages of a recording again."""
    with source.open("rb") as file, target.open("wb") as out:
        reader, writer = mcap_reader.make_reader(file), Writer(out, enable_crcs=False, **how)
        writer.start("", "x")
        for each in reader.iter_metadata():
            writer.add_metadata(each.name, each.metadata)
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        for _, (schema, channel, message) in zip(range(60), reader.iter_messages(), strict=False):
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(channel.topic, "json", schemas[schema.id])
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()


def read_or_refused(path: Path) -> None:
    """Read a file, and write its content as a table."""
    try:
        run = load(path)
        if any(track.times for track in run.tracks.values()):
            write_csv(run, path.with_suffix(".csv"))
    except UserError as error:
        assert str(path) in error.message  # noqa: PT017  # most are read


def test_any_mutation_of_a_recording_is_read_or_refused(variants, tmp_path):
    drawn, path = random.Random(37), tmp_path / "wrong.mcap"
    for _ in range(300):
        path.write_bytes(mutated(drawn.choice(variants), drawn))
        read_or_refused(path)


def test_any_mutation_of_a_kept_fault_is_read_or_refused(tmp_path):
    form = AxisForm(100.0, 100.0, 0.001, {"position": "deg", "velocity": "deg/s", "torque": "N·m", "": ""})
    packed = RowForm(2).struct
    rows = b"".join(packed.pack(now, *[1, 2, 3, 4, 5, 0, 8, 0x1237, 3, 2, 255] * 2) for now in range(20))
    path = tmp_path / "one.fault"
    fault_file.write(path, {"x": form, "y": form}, rows, [RecordedEvent(1.0, "nmt", "node 1", "lost")], BEGAN)
    assert len(load(path).tracks["x"].times) == 20
    whole, drawn = path.read_bytes(), random.Random(37)
    for _ in range(500):
        path.write_bytes(fault_file.MAGIC + mutated(whole.removeprefix(fault_file.MAGIC), drawn))
        read_or_refused(path)


def test_a_fault_that_does_not_fit_on_the_disk_leaves_nothing(tmp_path, monkeypatch):
    def full(path: Path, data: bytes) -> int:
        with path.open("wb") as file:
            file.write(data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left"):
        fault_file.write(tmp_path / "one.fault", {}, b"rows", [], BEGAN)
    assert list(tmp_path.iterdir()) == []
