"""Faults that a core stores automatically: the axes around each, the newest of them, whatever the program does."""

from __future__ import annotations

import random
import subprocess
import sys
import textwrap
import time
from contextlib import suppress

import pytest

from axisbus.core.process.persistence.journal import FAULT, faults_of, folder_of
from axisbus.errors import DriveError, UserError
from axisbus.machine.machine import Machine
from axisbus.record.fault_file import MAGIC
from axisbus.record.load import load
from kit import command_line
from kit.scenarios.core_process import OWN_PROCESS, own_cell

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
OVER_TEMPERATURE = 0x4310


@pytest.fixture
def file(tmp_path, monkeypatch, core_in_threads):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return own_cell(tmp_path)


def kept(file) -> list:
    """The faults of a cell, once there is one."""
    until = time.monotonic() + 10.0
    while not faults_of(str(file)) and time.monotonic() < until:
        time.sleep(0.05)
    return faults_of(str(file))


def test_a_fault_is_kept_with_the_seconds_around_it(file):
    with Machine.open(file) as machine:
        x = machine["x"]
        x.enable().wait(20)
        handle = x.move_velocity(30.0)
        machine.sleep(2.0)
        machine.simulated_node(1).fault(OVER_TEMPERATURE)
        assert machine.session.waiter.wait(lambda: x.error is not None, 5.0)
        assert isinstance(x.error, DriveError)
        assert not handle.active
        (path,) = kept(file)
        assert machine.fault_recordings == [path]
        assert path.parent == folder_of(str(file))
    fault = load(path)
    track = fault.tracks["x"]
    states = track.columns["state"]
    stop = track.times[states.index("ErrorStop")]
    assert stop == pytest.approx(1.5, abs=0.1)
    assert fault.seconds == pytest.approx(2.5, abs=0.1)
    assert set(states) == {"ContinuousMotion", "ErrorStop"}
    assert track.columns["velocity"][0] == pytest.approx(30.0, abs=1.0)
    assert track.units["velocity"] == "deg/s"
    emcy = next(event for event in fault.events if event.sort == "emcy")
    assert "0x4310" in emcy.text
    assert emcy.time == pytest.approx(stop, abs=0.1)
    assert fault.facts["drives"] == "simulated"
    assert faults_of(str(file)) == [path]


def test_a_fault_that_a_program_dies_of_is_kept_with_its_stop(file):
    program = f"""
        from axisbus import Machine
        with Machine.open({str(file)!r}) as machine:
            x = machine["x"]
            x.enable().wait(20)
            handle = x.move_relative(3000.0, velocity=30.0)
            machine.sleep(0.5)
            machine.simulated_node(1).fault({OVER_TEMPERATURE})
            handle.wait(20)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, check=False
    )
    assert "went into fault" in done.stderr
    (path,) = faults_of(str(file))
    fault = load(path)
    assert "ErrorStop" in fault.tracks["x"].columns["state"]
    assert abs(fault.tracks["x"].columns["velocity"][-1]) < 1.0
    assert any(event.sort == "command" and "ended" in event.text for event in fault.events)


def test_without_a_fault_nothing_is_stored(file, monkeypatch, capsys):
    with Machine.open(file) as machine:
        machine["x"].enable().wait(20)
        machine["x"].move_absolute(1.0).wait(20)
    assert faults_of(str(file)) == []
    code, out, _ = command_line.runner(monkeypatch, capsys)("record", "faults", file)
    assert (code, out) == (0, f"no fault of {file} has been stored\n")


def test_the_newest_are_kept_listed_and_drawn(file, monkeypatch, capsys, tmp_path):
    folder = folder_of(str(file))
    folder.mkdir(parents=True)
    for number in range(25):
        (folder / f"2020-01-01T00-00-{number:02d}.000{FAULT}").write_bytes(MAGIC + b"no fault")
    with Machine.open(file) as machine:
        machine["x"].enable().wait(20)
        machine.simulated_node(1).fault(OVER_TEMPERATURE)
        machine.sleep(1.5)
    found = faults_of(str(file))
    assert len(found) == 20
    assert found[-1].name > "2026"
    axisbus = command_line.runner(monkeypatch, capsys)
    code, out, err = axisbus("record", "faults", file)
    assert code == 0
    assert "x in ErrorStop; node 1: 0x4310" in out
    assert "is not a complete fault file of axisbus" in out
    assert f"next: axisbus plot {found[-1]}" in out + err
    pytest.importorskip("matplotlib")
    assert axisbus("plot", found[-1], "-o", tmp_path / "fault.png").code == 0


def test_a_fault_that_is_cut_off_or_wrong_is_no_surprise(file, tmp_path):
    with Machine.open(file) as machine:
        machine["x"].enable().wait(20)
        machine.simulated_node(1).fault(OVER_TEMPERATURE)
        machine.sleep(1.5)
    whole, drawn = faults_of(str(file))[-1].read_bytes(), random.Random(3)
    path = tmp_path / "wrong.fault"
    for number in range(200):
        data = bytearray(whole[: drawn.randrange(len(whole))] if number % 2 else whole)
        if data:
            data[drawn.randrange(len(data))] = drawn.randrange(256)
        path.write_bytes(data)
        with suppress(UserError):
            load(path)


def test_an_unwritable_folder_is_reported_and_disturbs_nothing(file, caplog):
    folder = folder_of(str(file))
    folder.parent.mkdir(parents=True)
    folder.write_text("in the way", encoding="utf-8")
    with Machine.open(file) as machine:
        x = machine["x"]
        x.enable().wait(20)
        machine.simulated_node(1).fault(OVER_TEMPERATURE)
        machine.sleep(1.5)
        x.reset().wait(10)
        x.enable().wait(10)
        x.move_relative(1.0).wait(20)
    assert any("was not stored" in record.message for record in caplog.records)
