"""Captures that wait for an edge of an input or for a touch probe over a bus, wherever the core runs."""

from __future__ import annotations

import time

import pytest

from axisbus.machine.machine import Machine
from axisbus.record.load import load
from kit import command_line
from kit.cell import cell_file
from kit.io_module import MODULE
from kit.scenarios.core_process import OWN_PROCESS

pytest.importorskip("mcap")
pytestmark = [
    pytest.mark.timeout(120),
    OWN_PROCESS,
]
BOTH = pytest.mark.parametrize("process", ["thread", "own"])


def file_of(folder, process, bus=""):
    return cell_file(
        folder, "x", heartbeat="1s", bus=f'process = "{process}"\n{bus}', more=MODULE.format(node="")
    )


def moment(run) -> float:
    (event,) = [event for event in run.events if event.text.startswith("the moment")]
    return event.time


@BOTH
@pytest.mark.parametrize("bus", ["", "sync = false"], ids=["SYNC", "events"])
def test_a_short_pulse_of_an_input_is_seen(tmp_path, process, bus, core_in_threads):
    path = tmp_path / "moment.mcap"
    with Machine.open(file_of(tmp_path, process, bus)) as machine:
        wired = machine.simulated_node(5).device.io
        with machine.capture(path, "part = true", before=0.3, after=0.3) as capture:
            time.sleep(0.5)
            assert not capture.fired
            began = time.monotonic()
            wired.set_bit(0x6000, 1, 2, True)
            time.sleep(0.04)  # less than a core reports at once
            wired.set_bit(0x6000, 1, 2, False)
            assert capture.wait(10.0)
            assert abs(capture._fired - began) < 0.1
    run = load(path)
    assert moment(run) == pytest.approx(0.3, abs=0.05)
    assert run.seconds == pytest.approx(0.6, abs=0.1)


@BOTH
def test_a_touch_probe_is_a_moment(tmp_path, process, core_in_threads):
    path = tmp_path / "moment.mcap"
    with Machine.open(file_of(tmp_path, process)) as machine:
        x = machine["x"]
        with (
            machine.capture(path, "x.probe", before=0.2, after=0.2) as capture,
            x.probe(continuous=True) as probe,
        ):
            time.sleep(0.4)
            probe.wait_armed(10)
            machine.simulated_node(1).drive().touch_probe.set_input(1, True)
            found = probe.next(10)
            assert capture.wait(10.0)
            assert capture._fired == pytest.approx(found.time, abs=0.005)
    assert moment(load(path)) == pytest.approx(0.2, abs=0.05)


def test_another_program_keeps_the_moment_of_an_input_and_of_a_touch_probe(tmp_path):
    file = file_of(tmp_path, "own")
    with Machine.open(file) as machine:
        drive, module = machine.simulated_node(1).drive(), machine.simulated_node(5).device.io
        runs = []
        for when, cause in (
            ("part = true", lambda level: module.set_bit(0x6000, 1, 2, level)),
            ("x.probe", lambda level: drive.touch_probe.set_input(1, level)),
        ):
            path = tmp_path / f"{when[0]}.mcap"
            options = ("--when", when, "--before", "200ms", "--after", "0.2", "--for", "60")
            recording = command_line.started("record", file, "-o", path, *options)
            with machine["x"].probe(continuous=True) as probe:
                probe.wait_armed(30)
                while recording.poll() is None:  # repeatedly: the begin of the recording is not reported
                    cause(True)
                    time.sleep(0.3)
                    cause(False)
                    time.sleep(0.3)
            out, err = recording.communicate(timeout=30)
            assert recording.returncode == 0, err
            assert f"recorded: {path}" in out
            runs.append(load(path))
    for run in runs:
        assert 0.0 <= moment(run) < 0.26
        assert 0.2 <= run.seconds - moment(run) < 0.3
