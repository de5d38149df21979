"""Inputs and outputs over a bus, wherever the core runs: mapped, seen, set, and safe when the core or the program is killed."""

from __future__ import annotations

import csv
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.core.process.persistence.journal import path_of
from axisbus.errors import ArgumentError, AxisbusError, BootError, NodeError, StaleError
from axisbus.machine.machine import Machine
from axisbus.record.load import load
from kit.cell import cell_file, cell_text
from kit.io_module import MODULE
from kit.plant_probe import OFF
from kit.stop_report import STOPPED

IO = (
    MODULE
    + """
[io.clamp]
node = 5
object = "6200h:01"
bit = 7
safe = 1
[io.valve]
node = 5
object = "6411h:02"
safe = 0
[io.relay]
node = 1
object = "60FEh:01"
bit = 16
safe = 0
"""
)
BOTH = pytest.mark.parametrize("process", ["thread", "own"])


def opened(
    folder: Path, process: str = "thread", node: str = "", bus: str = "", beat: str = "100ms"
) -> Machine:
    path = folder / "cell.toml"
    path.write_text(
        cell_text("x", heartbeat=beat, bus=f'process = "{process}"\n{bus}', more=IO.format(node=node))
    )
    return Machine.open(path)


def until(happened, limit: float = 5.0) -> None:
    end = time.monotonic() + limit
    while not happened():
        assert time.monotonic() < end, "it has not happened"
        time.sleep(0.005)


@BOTH
@pytest.mark.parametrize("bus", ["", "sync = false"], ids=["SYNC", "events"])
def test_inputs_and_outputs_are_read_and_set_over_the_bus(tmp_path, process, bus, core_in_threads):
    with opened(tmp_path, process, bus=bus) as cell:
        wired, io = cell.simulated_node(5).device.io, cell.io
        wired.set_bit(0x6000, 1, 2, True)
        assert io["part"].wait(True, timeout=2.0) is True
        io.set({"lamp": True, "valve": -1234, "relay": True}).wait(2)
        until(lambda: (wired.get(0x6200, 1), wired.get(0x6411, 2)) == (8, -1234))
        until(lambda: cell.simulated_node(1).device.io.get(0x60FE, 1) == 1 << 16)
        cell["x"].enable().wait(5)
        cell["x"].move_relative(10.0).wait(5)
        assert io["lamp"].value is True
        cell.close()
        assert (wired.get(0x6200, 1), wired.get(0x6411, 2)) == (0x00, 0)
        assert cell.simulated_node(1).device.io.get(0x60FE, 1) == 0


@BOTH
def test_inputs_and_outputs_are_in_a_recording_by_their_names(tmp_path, process, core_in_threads):
    pytest.importorskip("mcap")
    path = tmp_path / "io.mcap"
    with opened(tmp_path, process) as cell:
        wired = cell.simulated_node(5).device.io
        with cell.recording(path, objects=["part", "lamp", "valve"]):
            cell.io.set({"lamp": True, "valve": 700}).wait(2)
            wired.set_bit(0x6000, 1, 2, True)
            cell.io["part"].wait(True, timeout=2.0)
            cell.sleep(0.3)
        with pytest.raises(ArgumentError, match="input or output"):
            cell.recording(path, objects=["lamps"])
    objects = load(path).objects
    seen = {name: list(dict.fromkeys(track.columns["value"])) for name, track in objects.items()}
    assert seen["part"] == [False, True]
    assert seen["lamp"][-1] is True
    assert seen["valve"][-1] == 700


def test_a_lost_module_is_unknown_and_has_safe_outputs_when_it_returns(tmp_path, core_in_threads):
    with opened(tmp_path, node='on_lost = "report"') as cell:
        device, io = cell.simulated_node(5).device, cell.io
        io.set({"lamp": True, "clamp": False}).wait(2)
        until(lambda: device.io.get(0x6200, 1) == 8)
        device.dials.dead = True
        with pytest.raises(StaleError, match="part"):
            io["part"].wait(True, timeout=3.0)
        with pytest.raises(StaleError, match="lamp"):
            io["lamp"].wait(False, timeout=3.0)
        with pytest.raises(NodeError, match="lamp = True was not sent"):
            io["lamp"].set(True).wait(2)
        until(lambda: device.io.get(0x6200, 1) == 0x80)  # without the master: the node cannot be reached
        device.dials.dead = False


def test_after_a_loss_no_frame_restores_the_other_outputs_of_the_rpdo(tmp_path, core_in_threads):
    """The RPDO of the module holds its second byte, too, which the cell file does not name, and which was found on at boot-up."""
    with opened(tmp_path, node='on_lost = "report"\n[nodes.5.objects]\n"6200:02" = 0x55') as cell:
        device, lamp = cell.simulated_node(5).device, cell.io["lamp"]
        lamp.set(True).wait(2)
        until(lambda: device.io.get(0x6200, 1) == 8)
        assert device.io.get(0x6200, 2) == 0x55
        device.dials.dead = True
        with pytest.raises(StaleError, match="lamp"):
            lamp.wait(False, timeout=3.0)
        until(lambda: device.io.get(0x6200, 2) == 0)  # without the master
        device.dials.dead = False
        until(lambda: cell.node(5).nmt is NmtState.PRE_OPERATIONAL)
        cell.node(5).command(NmtCommand.START)
        until(lambda: _is_known(lamp))
        lamp.set(True).wait(2)
        assert device.io.get(0x6200, 1) == 0x88
        assert device.io.get(0x6200, 2) == 0


def _is_known(signal) -> bool:
    try:
        return signal.value is not None
    except StaleError:
        return False


def test_a_module_that_does_not_accept_its_error_value_is_refused_at_boot_up(tmp_path, core_in_threads):
    path = cell_file(tmp_path, "x", bus='process = "thread"', more=IO.format(node=""))
    eds = (Path(__file__).parents[2] / "eds" / "generic-cia401.eds").read_text()
    head, section, tail = eds.partition("[6207sub1]")
    (tmp_path / "module.eds").write_text(head + section + tail.replace("AccessType=rw", "AccessType=ro", 1))
    path.write_text(path.read_text().replace("builtin:generic-cia401", "module.eds"))
    with pytest.raises(BootError, match=r"6207h:01 does not accept 0, so its outputs have no safe state"):
        Machine.open(path)


def test_a_killed_core_leaves_safe_outputs(tmp_path):
    machine = opened(tmp_path, "own")
    wired, drive = machine.simulated_node(5).device.io, machine.simulated_node(1).device.io
    machine["x"].enable().wait(5)
    machine["x"].move_velocity(50.0).wait(5)
    machine.io.set({"lamp": True, "clamp": False, "relay": True}).wait(2)
    until(lambda: wired.get(0x6200, 1) == 8 and drive.get(0x60FE, 1) == 1 << 16)
    os.kill(machine._core.process, signal.SIGKILL)
    until(
        lambda: wired.get(0x6200, 1) == 0x80 and drive.get(0x60FE, 1) == 0, limit=8.0
    )  # of the drive: by the watchdog process alone
    until(lambda: machine.session.ended, limit=8.0)
    with pytest.raises(StaleError):
        _ = machine.io["lamp"].value
    with pytest.raises(AxisbusError) as told:
        machine.close()
    assert re.search(STOPPED, str(told.value))
    assert "its watchdog process set outputs to their safe states: relay, lamp, clamp" in str(told.value)
    assert "NOT CONFIRMED" not in str(told.value)


PROGRAM = """
import os, signal, sys, time
from axisbus import Machine
cell = Machine.open(sys.argv[1])
cell["x"].enable().wait(5)
cell["x"].move_velocity(90.0).wait(5)
cell.io.set({"lamp": True, "clamp": False}).wait(2)
time.sleep(0.2)
print("set", flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_program_leaves_safe_outputs_once_its_axis_is_off(tmp_path):
    """The plant is read from the history of the simulated devices; their own monitoring of the master is too slow to help."""
    path = tmp_path / "cell.toml"
    bus = 'process = "own"\noptions = { history = "plant.csv" }'
    path.write_text(cell_text("x", heartbeat="1s", bus=bus, more=IO.format(node="")))
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(path)], capture_output=True, text=True, timeout=30, check=False
    )
    assert ran.stdout.strip() == "set", ran.stderr
    until(lambda: "the core ended" in journal_text(path), limit=10.0)
    assert "leaving: the program has ended" in journal_text(
        path
    )  # "or has closed its connection", while its descriptors are closed
    assert "went wrong" not in journal_text(path)  # each output was read back
    outputs, stages = plant(tmp_path / "plant.csv")
    lamp_on = [at for at, word in outputs if word == 8]
    driven = [at for at, stage in stages if stage not in OFF]
    assert lamp_on
    assert driven
    assert outputs[-1][1] == 0x80
    assert max(lamp_on) > max(driven) - 0.005  # to within a line of the file


def plant(path: Path) -> tuple[list[tuple[float, int]], list[tuple[float, int]]]:
    """The first digital outputs, and the power stage of the axis, each with its times."""
    with path.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["outputs"] is not None]
    modules = [(float(row["time"]), row["outputs"].split()[0]) for row in rows if row["outputs"]]
    outputs = [(at, int(text.removeprefix("6200h:01="))) for at, text in modules]
    return outputs, [(float(row["time"]), int(row["stage"])) for row in rows if row["stage"]]


def journal_text(path: Path) -> str:
    """Return the lines of the core's journal."""
    return path_of(str(path)).read_text()


def test_a_dead_module_delays_closing_without_a_fault_of_the_drive(tmp_path, core_in_threads):
    """It is asked for longer than the drive waits for our heartbeat, which continues meanwhile."""
    cell = opened(tmp_path, node='on_lost = "report"', beat="200ms")
    cell.io.set({"lamp": True, "valve": 5}).wait(2)
    cell.simulated_node(5).device.dials.dead = True
    drive = cell.simulated_node(1).device
    began = time.monotonic()
    with pytest.raises(ExceptionGroup) as told:
        cell.close()
    assert 0.7 < time.monotonic() - began < 5.0  # three heartbeats are 0.6 s
    assert sorted(error.message.split()[0] for error in told.value.exceptions) == ["lamp", "valve"]
    assert list(drive.errors.entries) == []
