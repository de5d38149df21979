"""``axisbus record``, ``axisbus plot`` and ``--record``: of a cell of their own, and of a machine that runs."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import time

import pytest

from axisbus.machine.machine import Machine
from axisbus.record.load import load
from kit import command_line
from kit.cell import cell_file
from kit.scenarios.core_process import OWN_PROCESS, own_cell, turns, under_way

pytest.importorskip("mcap")
pytestmark = [pytest.mark.timeout(120)]


@pytest.fixture
def cell(tmp_path):
    return cell_file(tmp_path, "xy", period="20ms", heartbeat="1s")


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """Two recordings of a move, made by a program."""
    folder = tmp_path_factory.mktemp("moved")
    file = cell_file(folder, "xy", period="20ms", heartbeat="1s")
    for name, goal in (("a", 10.0), ("b", 12.0)):
        with Machine.simulated(file) as machine:
            machine["x"].enable().wait()
            with machine.recording(folder / f"{name}.mcap"):
                machine["x"].move_absolute(goal).wait()
    return folder


# -- made ------------------------------------------------------------------------------------------------------------------------


def test_a_cell_is_booted_and_recorded_and_energised_by_nothing(axisbus, cell, tmp_path):
    path = tmp_path / "run.mcap"
    code, out, err = axisbus(
        "record", cell, "-o", path, "--for", "1s", "--axes", "y", "--objects", "x:6061,2:1001"
    )
    assert code == 0, err
    run = load(path)
    assert list(run.tracks) == ["y"]
    assert set(run.tracks["y"].columns["state"]) == {"Disabled"}
    assert 0.8 < run.seconds < 3.0
    assert set(run.objects) == {"x:6061", "2:1001"}
    assert set(run.objects["2:1001"].columns["value"]) == {0}
    assert f"recorded: {path}" in out
    assert re.search(r"; x:6061: \d+ values \(", out)
    assert f"next: axisbus plot {path}" in err + out


@pytest.mark.parametrize(
    ("command", "state"),
    [
        (("move", "CELL", "x=5", "--home"), "DiscreteMotion"),
        (("home", "CELL", "x"), "Homing"),
        (("velocity", "CELL", "x=30", "--for", "300ms"), "ContinuousMotion"),
    ],
)
def test_a_command_that_moves_is_recorded(axisbus, cell, tmp_path, command, state):
    path = tmp_path / "run.mcap"
    code, out, err = axisbus(*(cell if word == "CELL" else word for word in command), "--record", path)
    assert code == 0, err
    run = load(path)
    assert state in run.tracks["x"].columns["state"]
    assert run.lacks == ""
    assert any(event.sort == "command" and event.where.startswith("x.") for event in run.events)
    assert f"recorded: {path}" in out


@OWN_PROCESS
@pytest.mark.parametrize(
    "command",
    [
        ("move", "CELL", "x=5", "--home"),
        ("home", "CELL", "x"),
        ("velocity", "CELL", "x=30", "--for", "300ms"),
    ],
)
def test_a_command_whose_recording_cannot_be_written_continues_and_sets_the_exit_code(
    axisbus, cell, tmp_path, monkeypatch, command
):
    resource = pytest.importorskip("resource")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    path, before = tmp_path / "run.mcap", resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8_000, before[1]))  # as on a disk that is full
    try:
        code, out, _ = axisbus(*(cell if word == "CELL" else word for word in command), "--record", path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert code == 3
    assert re.search(rf"recorded: {path}.*could not be written: .*File too large", out)
    assert re.search(r"^x: .*\d", out, re.MULTILINE)  # where it is in the end


def test_a_file_that_is_there_is_not_replaced_by_chance(axisbus, cell, tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"precious")
    code, _, err = axisbus("record", cell, "-o", path, "--for", "1")
    assert (code, path.read_bytes()) == (1, b"precious")
    assert "already exists" in err
    assert "--force" in err


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--axes", "w"), "no axis 'w'"),
        (("--objects", "x:nothing"), "no object 'nothing'"),
        (("--objects", "6064"), "names no object"),
        (("--for", "2 weeks"), "is not a valid time"),
    ],
)
def test_an_invalid_recording_is_refused_and_nothing_is_written(axisbus, cell, tmp_path, options, text):
    path = tmp_path / "run.mcap"
    code, _, err = axisbus("record", cell, "-o", path, *options)
    assert code in (1, 2)
    assert text in err
    assert not path.exists()


# -- beside a program ------------------------------------------------------------------------------------------------------------


@OWN_PROCESS
def test_a_running_machine_is_joined_and_the_motion_of_its_program_is_recorded(
    axisbus, tmp_path, core_in_threads
):
    file, path = own_cell(tmp_path), tmp_path / "run.mcap"
    with Machine.open(file) as machine:
        x = machine["x"]
        x.enable().wait(20)
        handle = under_way(x)
        code, _, err = axisbus(
            "record", file, "-o", path, "--for", "1.5", "--objects", "x:6064,x:6040,x:6081"
        )
        assert code == 0, err
        assert "joined the running machine" in err
        assert handle.active
        assert abs(turns(machine)) == pytest.approx(30.0, abs=1.0)
        x.halt().wait(10)
    run = load(path)
    assert set(run.tracks["x"].columns["state"]) == {"DiscreteMotion"}
    assert max(map(abs, run.tracks["x"].columns["velocity"])) == pytest.approx(30.0, abs=1.0)
    cycles = len(run.tracks["x"].times)
    position, word, polled = (run.objects[f"x:{index}"] for index in ("6064", "6040", "6081"))
    for carried in (position, word):  # in a PDO each, in both directions
        assert len(carried.times) == pytest.approx(cycles, abs=0.2 * cycles)
    assert set(word.columns["value"]) <= {0x0F, 0x1F, 0x2F, 0x3F}
    seen = position.columns["value"]
    assert abs(seen[-1] - seen[0]) > 1000
    assert 0 < len(polled.times) != len(position.times)


@OWN_PROCESS
def test_the_recording_of_a_killed_program_can_be_read_up_to_its_last_second(tmp_path):
    file, path = own_cell(tmp_path), tmp_path / "run.mcap"
    with command_line.started("record", file, "-o", path) as recording:
        until = time.monotonic() + 60.0
        while not (path.exists() and path.stat().st_size > 12_000) and time.monotonic() < until:
            time.sleep(0.05)
        time.sleep(3.0)
        recording.kill()
    run = load(path)
    assert "within a write" in run.lacks
    assert run.seconds > 2.0
    times = run.tracks["x"].times
    assert len(times) > 0.9 * run.seconds / 0.02


@OWN_PROCESS
def test_ctrl_c_is_the_usual_end(tmp_path):
    file, path = own_cell(tmp_path), tmp_path / "run.mcap"
    recording = command_line.started("record", file, "-o", path)
    until = time.monotonic() + 60.0
    while not path.exists() and time.monotonic() < until:
        time.sleep(0.05)
    time.sleep(1.5)
    os.kill(recording.pid, signal.SIGINT)
    out, err = recording.communicate(timeout=60)
    assert recording.returncode == 0, err
    assert f"recorded: {path}" in out
    assert load(path).lacks == ""


# -- looked at -------------------------------------------------------------------------------------------------------------------


def test_a_recording_is_drawn(axisbus, moved, tmp_path):
    pytest.importorskip("matplotlib")
    code, out, err = axisbus(
        "plot", moved / "a.mcap", "-o", tmp_path / "a.svg", "--from", "0.1", "--to", "0.4"
    )
    assert code == 0, err
    assert f"written: {tmp_path / 'a.svg'}" in out
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert "a.mcap" in text
    assert "simulated drives" in text
    for options, error in (
        (("--from", "3", "--to", "2"), "--from must be less than --to"),
        (("-o", tmp_path / "a.bmp"), "not a picture that can be drawn"),
        (("--from", "300"), "nothing to draw"),
    ):
        code, _, err = axisbus("plot", moved / "a.mcap", *options)
        assert code in (1, 2)
        assert error in err


def test_two_recordings_are_laid_over_each_other(axisbus, moved):
    code, out, _ = axisbus("record", "diff", moved / "a.mcap", moved / "b.mcap")
    assert code == 0
    line = next(line for line in out.splitlines() if line.startswith("x       position"))
    assert float(line.split()[2]) == pytest.approx(2.0, abs=0.05)
    code, out, _ = axisbus("record", "diff", moved / "a.mcap", moved / "b.mcap", "--within", "1.5", "--json")
    assert code == 1
    first = json.loads(out)["deviations"][0]
    assert (first["axis"], first["column"], first["unit"]) == ("x", "position", "deg")
    assert axisbus("record", "diff", moved / "a.mcap", moved / "b.mcap", "--within", "2.5").code == 0


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_recording_is_exported(axisbus, moved, tmp_path, kind):
    pandas = pytest.importorskip("pandas")
    path = tmp_path / f"run.{kind}"
    code, out, err = axisbus("record", "export", moved / "a.mcap", "-o", path)
    assert (code, out) == (0, f"written: {path}\n"), err
    table = pandas.read_csv(path) if kind == "csv" else pandas.read_parquet(path)
    column = "x.position [deg]" if kind == "csv" else "x.position"
    assert table[column].iloc[-1] == pytest.approx(10.0, abs=0.05)
    code, _, err = axisbus("record", "export", moved / "a.mcap", "-o", path)
    assert "already exists" in err
    assert (
        "end its name in .csv or .parquet"
        in axisbus("record", "export", moved / "a.mcap", "-o", tmp_path / "a.xls").err
    )


@pytest.mark.parametrize("kind", ["csv", "parquet", "svg"])
def test_an_export_that_fails_or_is_killed_leaves_the_file_that_was_there(
    axisbus, moved, tmp_path, monkeypatch, kind
):
    pytest.importorskip({"csv": "csv", "parquet": "pyarrow", "svg": "matplotlib"}[kind])
    path, seen = tmp_path / f"run.{kind}", list[bytes]()
    path.write_bytes(b"the last one")
    sync = os.fsync

    def full(file: int) -> None:
        """The disk is full when the last bytes are written; a program killed here would leave the same."""
        seen.append(path.read_bytes())
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    first = ("plot", moved / "a.mcap", "-o", path)
    command = first if kind == "svg" else ("record", "export", moved / "a.mcap", "-o", path, "--force")
    code, _, err = axisbus(*command)
    assert code == 1
    assert f"{path} cannot be written" in err
    assert seen == [b"the last one"]
    assert path.read_bytes() == b"the last one"
    assert list(tmp_path.iterdir()) == [path]
    monkeypatch.setattr(os, "fsync", sync)
    assert axisbus(*command).code == 0
    assert path.stat().st_size > 1000


# -- moments ---------------------------------------------------------------------------------------------------------------------


@OWN_PROCESS
def test_a_moment_of_a_running_program_is_recorded(tmp_path):
    file, path = own_cell(tmp_path), tmp_path / "moment.mcap"
    with Machine.open(file) as machine:
        x = machine["x"]
        x.enable().wait(20)
        options = ("--when", "|x.velocity| > 15", "--before", "200ms", "--after", "0.3", "--for", "60")
        recording = command_line.started("record", file, "-o", path, *options)
        assert "joined" in recording.stderr.readline()
        time.sleep(1.0)
        x.move_relative(-200.0, velocity=30.0)
        out, err = recording.communicate(timeout=30)
        x.halt().wait(10)
    assert recording.returncode == 0, err
    assert f"recorded: {path}" in out
    run = load(path)
    assert run.seconds == pytest.approx(0.5, abs=0.1)
    assert min(run.tracks["x"].columns["velocity"]) < -15.0


def test_a_moment_that_does_not_occur_is_reported(axisbus, cell, tmp_path):
    path = tmp_path / "none.mcap"
    code, out, _ = axisbus("record", cell, "-o", path, "--when", "fault", "--for", "300ms")
    assert (code, path.exists()) == (1, False)
    assert "the condition did not become true" in out
    for options, text in (
        (("--when", "x > 3"), "is not a condition"),
        (("--when", "fault", "--objects", "x:6041"), "leave --objects out"),
    ):
        code, _, err = axisbus("record", cell, "-o", path, *options)
        assert code == 2
        assert text in err
