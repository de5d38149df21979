"""Recordings as files: observed values and events are in them, for any reader and any end."""

from __future__ import annotations

import json
import logging
import math
import random
from contextlib import suppress
from itertools import pairwise

import pytest

from axisbus import Machine, Recorder, wait
from axisbus.errors import ArgumentError, DriveError, StateError, UserError
from axisbus.motion.states import AxisState
from axisbus.record.load import load
from axisbus.record.recording import _MOST
from kit.pages import ROOT

mcap_reader = pytest.importorskip("mcap.reader")

CELL = ROOT / "examples" / "cell.toml"
OVER_TEMPERATURE = 0x4310


def job(cell: Machine) -> None:
    """Enable, home, move x and z, let y go into fault in its move, and reset it."""
    wait([axis.enable() for axis in cell])
    wait([axis.home() for axis in cell])
    wait([cell["x"].move_absolute(60.0), cell["z"].move_absolute(-30.0)])
    handle = cell["y"].move_absolute(40.0)
    cell.sleep(0.3)
    cell.simulated_node(2).fault(OVER_TEMPERATURE)
    with pytest.raises(DriveError):
        handle.wait()
    cell["y"].reset().wait()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A recording of the job, the samples of a recorder in memory of the same cycles, and its path."""
    path = tmp_path_factory.mktemp("recording") / "new" / "run.mcap"
    with Machine.simulated(CELL) as cell:
        with cell.recording(path) as recording, Recorder(cell) as recorder:
            job(cell)
        assert (recording.failed, recording.lost) == ("", 0)
        assert recording.cycles == len(recorder)
        assert recording.size == path.stat().st_size
    return path, recorder


@pytest.fixture(scope="module")
def run(made):
    return load(made[0])


# -- contents --------------------------------------------------------------------------------------------------------------------


def test_every_cycle_of_every_axis_is_in_it_in_units(made, run):
    _, recorder = made
    seen = recorder.recorded()
    assert list(run.tracks) == ["x", "y", "z"]
    for name, track in run.tracks.items():
        assert len(track.times) == len(recorder)
        assert track.units == {**seen.tracks[name].units}
        for column, values in track.columns.items():
            expected = seen.tracks[name].columns[column]
            assert list(values) == pytest.approx(expected, nan_ok=True) if column != "state" else True
        assert [after - before for before, after in pairwise(track.times)] == pytest.approx(
            [0.004] * (len(track.times) - 1), abs=1e-6
        )
    assert run.tracks["x"].columns["position"][-1] == pytest.approx(60.0, abs=0.01)
    assert run.tracks["z"].columns["position"][-1] == pytest.approx(-30.0, abs=0.01)
    assert run.tracks["x"].units["position"] == "deg"
    assert run.tracks["x"].units["velocity"] == "deg/s"
    assert run.tracks["x"].units["torque"] == "N·m"
    assert (run.lacks, run.objects) == ("", {})


def test_the_states_and_the_following_error_are_those_of_the_motion(run):
    y, x = run.tracks["y"].columns, run.tracks["x"].columns
    assert list(dict.fromkeys(y["state"]))[:5] == [
        "Disabled", "Standstill", "Homing", "DiscreteMotion", "ErrorStop",
    ]  # fmt: skip
    assert "operation enabled" in x["power"]
    assert set(x["homed"]) == {False, True}
    assert {"pp", "hm"} <= set(x["mode"])
    for demand, position, behind in zip(x["demand"], x["position"], x["following_error"], strict=True):
        assert behind == pytest.approx(demand - position, abs=2e-4, nan_ok=True)
    assert max(behind for behind in x["following_error"] if behind == behind) > 0.05
    assert max(x["velocity"]) == pytest.approx(90.0, abs=1.0)


def test_commands_with_their_ends_and_the_fault_are_among_the_events_of_a_recording(run):
    commands = [(event.where, event.text) for event in run.events if event.sort == "command"]
    assert ("x.move_absolute(60 deg)", "given") in commands
    assert ("x.move_absolute(60 deg)", "done") in commands
    ended = dict(commands)["y.move_absolute(40 deg)"]
    assert ended.startswith("ended: y: the drive went into fault")
    fault = next(event for event in run.events if event.sort == "emcy")
    assert fault.where == "node 2"
    assert "0x4310" in fault.text
    aborted = next(e for e in run.events if e.where == "y.move_absolute(40 deg)" and e.text != "given")
    assert 0.0 <= aborted.time - fault.time < 0.05
    assert [event.time for event in run.events] == sorted(event.time for event in run.events)
    states = dict(zip(run.tracks["y"].times, run.tracks["y"].columns["state"], strict=True))
    stop = next(time for time, state in states.items() if state == "ErrorStop")
    assert stop == pytest.approx(fault.time, abs=0.02)


def test_a_recording_contains_the_cell_the_hashes_of_the_files_and_both_clocks(made, run):
    with made[0].open("rb") as file:
        reader = mcap_reader.make_reader(file)
        attached = {one.name: one.data for one in reader.iter_attachments()}
        offsets = {message.log_time - message.publish_time for _, _, message in reader.iter_messages()}
    assert attached["cell.toml"] == CELL.read_bytes()
    files = json.loads(attached["eds.json"])
    assert list(files) == ["1", "2", "3"]
    assert all(len(one["sha256"]) == 64 and one["file"].endswith("gim6010-8.eds") for one in files.values())
    assert len(offsets) == 1  # the time of day never leaps
    assert run.facts["drives"] == "simulated"
    assert run.facts["scan_period_s"] == "0.004"
    assert run.began is not None


def test_another_mcap_reader_finds_channels_with_schemas_and_units(made):
    with made[0].open("rb") as file:
        summary = mcap_reader.make_reader(file).get_summary()
    topics = {channel.topic: channel for channel in summary.channels.values()}
    assert {"axis/x", "axis/y", "axis/z", "events/command", "events/emcy", "events/nmt"} <= set(topics)
    schema = json.loads(summary.schemas[topics["axis/x"].schema_id].data)
    assert schema["properties"]["velocity"]["unit"] == "deg/s"
    assert summary.statistics.chunk_count > 1
    counts = {topics[topic].id: topic for topic in topics}
    told = {counts[number]: count for number, count in summary.statistics.channel_message_counts.items()}
    assert told["axis/x"] == told["axis/y"] == told["axis/z"] > 300


def test_objects_are_recorded_in_virtual_time_too_and_delay_no_cycle(tmp_path):
    """Those of x travel by SDO in turn, each with 260 bits at 5 % of 1 Mbit/s: every 5.2 ms. All at once would fill a cycle."""
    path = tmp_path / "objects.mcap"
    carried = ["lamp", "part", "pressure"]
    asked = [
        f"x:{index:04X}"
        for index in (*range(0x605A, 0x605F), *range(0x6065, 0x6068), *range(0x6083, 0x6087), 0x6098)
    ]
    with (
        Machine.simulated(ROOT / "examples" / "io.toml") as cell,
        cell.recording(path, objects=[*carried, *asked]) as made,
    ):
        began = cell.session.snapshots["x"].now
        cell.sleep(0.2)
        cell.io["lamp"].set(True).wait()
        cell.simulated_node(5).device.io.set_bit(0x6000, 1, 0, True)
        cell.sleep(0.2)
        seconds = cell.session.snapshots["x"].now - began
        made.close()
        assert (cell.cycle_jitter.worst, cell.cycle_jitter.skipped) == (0.0, 0)
    assert made.cycles == pytest.approx(seconds / 0.004, abs=1)
    reads = made.reads
    assert reads["part"] == reads["pressure"] == pytest.approx(made.cycles, abs=1)
    assert sum(reads[each] for each in asked) == pytest.approx(seconds / 0.0052, abs=2)
    assert max(reads[each] for each in asked) - min(reads[each] for each in asked) <= 1
    with path.open("rb") as file:
        found: dict[str, list[object]] = {}
        for _, channel, message in mcap_reader.make_reader(file).iter_messages():
            if channel.topic.startswith("object/"):
                found.setdefault(channel.topic, []).append(json.loads(message.data)["value"])
    assert {topic: len(values) for topic, values in found.items()} == {
        f"object/{each}": count for each, count in reads.items()
    }
    assert set(found["object/lamp"]) == {True}  # its RPDO is not sent before
    values = found["object/part"]
    assert (values[0], values[-1]) == (False, True)
    assert sorted(values) == values  # it changes once


def test_only_the_axes_that_are_named_are_recorded(tmp_path):
    with Machine.simulated(CELL) as cell:
        with cell.recording(tmp_path / "z.mcap", axes=["z"]):
            cell.sleep(0.1)
        with pytest.raises(StateError, match="no axis 'w'"):
            cell.recording(tmp_path / "w.mcap", axes=["w"])
    assert list(load(tmp_path / "z.mcap").tracks) == ["z"]
    assert not (tmp_path / "w.mcap").exists()


@pytest.mark.parametrize(
    ("wanted", "error", "text"),
    [
        ("6074", ArgumentError, "names no object"),
        ("w:6074", StateError, "no axis 'w'"),
        ("9:6074", StateError, "no node 9"),
        ("x:no such thing", ArgumentError, "no such thing"),
    ],
)
def test_unknown_objects_are_refused(tmp_path, wanted, error, text):
    with Machine.simulated(CELL) as cell, pytest.raises(error, match=text):
        cell.recording(tmp_path / "run.mcap", objects=[wanted])


# -- however it ends -------------------------------------------------------------------------------------------------------------


def test_the_stop_that_follows_an_error_is_recorded_too(tmp_path):
    path = tmp_path / "run.mcap"

    def program() -> None:
        with Machine.simulated(CELL) as cell, cell.recording(path):
            cell["x"].enable().wait()
            cell["x"].move_velocity(60.0).wait()
            cell.sleep(0.3)
            raise RuntimeError("a mistake of the program")

    with pytest.raises(RuntimeError, match="a mistake"):
        program()
    run = load(path)
    assert run.lacks == ""
    assert run.tracks["x"].columns["state"][-1] == "Disabled"
    assert run.tracks["x"].columns["velocity"][-1] == pytest.approx(0.0, abs=0.5)
    assert any(event.sort == "machine" and "RuntimeError" in event.text for event in run.events)


def test_a_disk_that_is_full_ends_the_recording_and_never_the_motion(tmp_path, caplog):
    with caplog.at_level(logging.WARNING), Machine.simulated(CELL) as cell:
        with pytest.raises(UserError, match="cannot be written"), cell.recording("/dev/full"):
            pass
        with cell.recording(tmp_path / "run.mcap") as recording, open("/dev/full", "wb", buffering=0) as full:
            recording._target._writer._stream._file = full  # after its head
            cell["x"].enable().wait()
            cell["x"].move_relative(300.0).wait()
        assert cell["x"].state is AxisState.STANDSTILL
        assert "No space left" in recording.failed
    told = [record.message for record in caplog.records if "has ended" in record.message]
    assert len(told) == 1
    assert "run.mcap has ended: it cannot be written" in told[0]


def test_cycles_that_cannot_be_written_in_time_are_counted_and_reported(tmp_path):
    path = tmp_path / "run.mcap"
    with Machine.simulated(CELL) as cell, cell.recording(path) as recording:
        cell.sleep(0.1)
        snapshots, now = cell.session.snapshots, recording._seen
        recording._last_events = math.inf  # no writing meanwhile
        for number in range(_MOST + 5):
            recording._observe(now + number, snapshots)
        assert 5 <= recording.lost <= 40
        recording._last_events = 0.0
    told = [event.text for event in load(path).events if event.sort == "recording"]
    assert told == [f"{recording.lost} cycles are missing: not read in time"]


def test_a_truncated_recording_is_read_as_far_as_possible(made, tmp_path, run):
    whole = made[0].read_bytes()
    path = tmp_path / "cut.mcap"
    last = 0
    head = whole.index(b"eds.json") + 1000
    for size in (*range(head, len(whole), len(whole) // 40), len(whole) - 9):
        path.write_bytes(whole[:size])
        found = load(path)
        count = len(found.tracks["x"].times) if found.tracks else 0
        assert count >= last
        if found.lacks:
            assert "within a write" in found.lacks
        last = count
    assert last == len(run.tracks["x"].times)


def test_bytes_that_are_wrong_are_no_surprise(made, tmp_path):
    whole, drawn = made[0].read_bytes(), random.Random(7)
    path = tmp_path / "wrong.mcap"
    for _ in range(150):
        data = bytearray(whole)
        for _ in range(drawn.randint(1, 4)):
            data[drawn.randrange(len(data))] = drawn.randrange(256)
        path.write_bytes(data)
        with suppress(UserError):
            load(path)


def test_a_wrong_length_allocates_no_more_memory_than_there_is(made, tmp_path):
    whole = bytearray(made[0].read_bytes())
    at = len(b"\x89MCAP0\r\n") + 9  # behind the head of the first record: the length of its first text
    path = tmp_path / "wrong.mcap"
    for length in (0xFF, 0xFFFF, 0x7FFF_FFFF, 0xFFFF_FFFF):
        path.write_bytes(whole[:at] + length.to_bytes(4, "little") + whole[at + 4 :])
        with suppress(UserError):
            assert load(path).lacks


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "not an MCAP file|not a recording"),
        (b"hello", "not an MCAP file|not a recording"),
        (b"\x89MCAP0\r\n", "not a recording"),
    ],
)
def test_a_file_that_is_no_recording_is_refused(tmp_path, data, text):
    path = tmp_path / "some.mcap"
    path.write_bytes(data)
    with pytest.raises(UserError, match=text):
        load(path)
    with pytest.raises(UserError, match="cannot be read"):
        load(tmp_path / "none.mcap")


def test_an_mcap_file_of_another_program_is_refused(tmp_path):
    from mcap.writer import Writer

    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("a", "json", writer.register_schema("a", "jsonschema", b"{}"))
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with pytest.raises(UserError, match="not a recording of axisbus"):
        load(path)


def test_without_the_package_the_error_names_it(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mcap.writer", None)
    with Machine.simulated(CELL) as cell, pytest.raises(UserError, match="need the package mcap") as told:
        cell.recording(tmp_path / "run.mcap").__enter__()
    assert "axisbus[record]" in told.value.remedy
    with pytest.raises(UserError, match="mcap"):
        load(tmp_path / "run.mcap")
