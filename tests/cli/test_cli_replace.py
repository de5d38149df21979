"""``axisbus replace`` as its user types it: on a bus without a machine, and joining a machine that runs."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from axisbus.configuration.replacement import DriveReplacement
from axisbus.configuration.replacement_order import ReplacementStep
from axisbus.eds import load
from axisbus.errors import StateError
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork
from kit import command_line
from kit.cell import cell_text
from kit.core_in_threads import core_in_threads
from kit.scenarios.core_process import OWN_PROCESS, enabled, own_cell, turns, under_way

OLD, NEW = 4711, 4712
CONFIGURED = {(0x6081, 0): 123_456, (0x607D, 1): -50_000}


@pytest.fixture
def drives(tmp_path):
    """The two drives of a cell on a bus of their own, and the cell file; the first one is configured."""
    eds = load(command_line.GENERIC)
    name = f"replace-{tmp_path.name}"
    made = [device_from_eds(eds, node_id, seed=node_id, serial=OLD + 10 * node_id - 10) for node_id in (1, 2)]
    (tmp_path / "cell.toml").write_text(cell_text("xy", interface="virtual", channel=name), encoding="utf-8")
    with SimulatedNetwork(name, made) as simulated_nodes:
        command_line.until(lambda: all(device.answers_sdo for device in made))
        with simulated_nodes.lock:
            for key, value in CONFIGURED.items():
                made[0].write(*key, value)
        yield simulated_nodes, tmp_path / "cell.toml"


@pytest.fixture
def saved(axisbus, drives):
    """The nameplates and the backup of node 1 are stored beside the cell file."""
    _, cell = drives
    assert axisbus("nameplate", cell, "--save").code == 0
    assert axisbus("config", "backup", "x", "--cell", cell, "-o", backup_of(cell)).code == 0


def backup_of(cell: Path) -> Path:
    return cell.with_name(f"node-1-serial-{OLD:X}.dcf")


def swap(simulated_nodes: SimulatedNetwork, *what: int) -> None:
    with simulated_nodes.lock:
        simulated_nodes.devices[0].swap(NEW, *what)
    time.sleep(0.3)


def held(simulated_nodes: SimulatedNetwork) -> dict[tuple[int, int], int]:
    with simulated_nodes.lock:
        return {key: simulated_nodes.devices[0].read(*key) for key in CONFIGURED}


def note_of(cell: Path) -> Path:
    return cell.with_name("cell.replacement-1.json")


def serial_in_record(cell: Path) -> int:
    record = json.loads(cell.with_name("cell.nameplate.json").read_text(encoding="utf-8"))
    return next(each["serial"] for each in record["nodes"] if each["node"] == 1)


# -- without a machine ---------------------------------------------------------------------------------------------------------


def test_a_drive_is_shown_then_replaced_and_then_there_is_nothing_to_replace(axisbus, drives, saved):
    simulated_nodes, cell = drives
    swap(simulated_nodes)
    factory = held(simulated_nodes)
    code, out, _ = axisbus("replace", cell, "x", "--plan")
    assert code == 0
    assert "node 1: the new drive was found at node-ID 1" in out
    assert "  serial number (1018h:04)    0x1267 (4711)" in out
    assert "0x1268 (4712)\n" in out
    assert f"configuration: {backup_of(cell)}" in out
    assert "  1. write the stored values that differ, except those that calibrate the drive\n" in out
    assert "  5. write its nameplate into the record\n" in out
    code, _, err = axisbus("replace", cell, "x")
    assert code == 2
    assert "give --yes" in err
    assert held(simulated_nodes) == factory
    assert serial_in_record(cell) == OLD
    assert not note_of(cell).exists()
    code, out, err = axisbus("replace", cell, "1", "--yes")
    assert code == 0, err
    assert "node 1: read every object again" in err
    assert "node 1 has been replaced: serial number 4712" in out
    assert f"next: axisbus boot {cell}" in out
    assert held(simulated_nodes) == CONFIGURED
    assert serial_in_record(cell) == NEW
    assert not note_of(cell).exists()
    code, _, err = axisbus("replace", cell, "x", "--yes")
    assert code == 1
    assert "node 1 has not been replaced; nothing was written" in err


def test_a_drive_without_a_node_id_is_replaced_and_reported_as_json(axisbus, drives, saved):
    simulated_nodes, cell = drives
    swap(simulated_nodes, 255)
    code, out, err = axisbus("replace", cell, "x", "--yes", "--json")
    assert code == 0, err
    told = json.loads(out)
    assert (told["drive"]["node_id"], told["drive"]["serial"], told["was"]["serial"]) == (None, NEW, OLD)
    assert told["steps"] == ["node_id", "configure", "store", "restart", "verify", "record"]
    assert told["outcome"]["written"] >= 2
    assert held(simulated_nodes) == CONFIGURED
    assert simulated_nodes.devices[0].lss.stored == 1
    assert axisbus("replace", cell, "x", "--json").code == 2


def test_another_product_is_refused_with_the_difference_and_leaves_no_note(axisbus, drives, saved):
    simulated_nodes, cell = drives
    record = json.loads(cell.with_name("cell.nameplate.json").read_text(encoding="utf-8"))
    record["nodes"][0]["product"] = 7
    cell.with_name("cell.nameplate.json").write_text(json.dumps(record), encoding="utf-8")
    swap(simulated_nodes, 1, None, None, 8)
    factory = held(simulated_nodes)
    code, _, err = axisbus("replace", cell, "x", "--yes")
    assert code == 1
    assert "product code (1018h:02) is 0x8 (8), expected is 0x7 (7)" in err
    assert held(simulated_nodes) == factory
    assert not note_of(cell).exists()


def test_a_drive_that_is_refused_before_a_write_leaves_no_note(axisbus, drives, saved):
    simulated_nodes, cell = drives
    swap(simulated_nodes)
    simulated_nodes.devices[0].dials.sdo_aborts[0x6081, 0] = 0x0602_0000
    code, _, err = axisbus("replace", cell, "x", "--yes")
    assert code == 1
    assert "nothing was written" in err
    assert not note_of(cell).exists()
    assert serial_in_record(cell) == OLD


def test_a_file_of_another_type_of_drive_is_refused_before_the_drive_gets_its_node_id(axisbus, drives, saved):
    simulated_nodes, cell = drives
    text = backup_of(cell).read_text(encoding="ascii")
    at = text.index("ParameterValue=", text.index("[1018sub2]"))
    backup_of(cell).write_text(
        f"{text[:at]}ParameterValue=7{text[text.index(chr(10), at) :]}", encoding="ascii"
    )
    swap(simulated_nodes, 255, None, None, 8)
    code, _, err = axisbus("replace", cell, "x", "--yes")
    assert code == 1
    assert "is not for a device of the type of node" in err
    assert "product code: the file has 0x7, the device 0x8" in err
    assert simulated_nodes.devices[0].node_id == 255
    assert not note_of(cell).exists()


def test_several_backups_are_not_guessed_among(axisbus, drives, saved):
    simulated_nodes, cell = drives
    for name in ("node-1.dcf", "node-1-serial-7.dcf"):
        cell.with_name(name).write_bytes(backup_of(cell).read_bytes())
    swap(simulated_nodes)
    assert f"configuration: {backup_of(cell)}" in axisbus("replace", cell, "x", "--plan").out
    backup_of(cell).unlink()
    code, _, err = axisbus("replace", cell, "x", "--plan")
    assert code == 1
    assert "beside it are node-1-serial-7.dcf, node-1.dcf" in err


def test_without_a_backup_the_user_chooses(axisbus, drives, saved, tmp_path):
    simulated_nodes, cell = drives
    moved = backup_of(cell).rename(tmp_path / "elsewhere.dcf")
    swap(simulated_nodes)
    factory = held(simulated_nodes)
    code, _, err = axisbus("replace", cell, "x", "--yes")
    assert code == 1
    assert "there is no stored configuration of node 1" in err
    assert axisbus("replace", cell, "x", "--file", moved, "--no-restore").code == 2
    code, _, err = axisbus("replace", cell, "x", "--no-restore", "--yes")
    assert code == 0, err
    assert held(simulated_nodes) == factory
    assert serial_in_record(cell) == NEW
    with simulated_nodes.lock:
        simulated_nodes.devices[0].swap(NEW + 1)
    time.sleep(0.3)
    assert axisbus("replace", cell, "x", "--file", moved, "--yes").code == 0
    assert held(simulated_nodes) == CONFIGURED


def test_without_a_record_the_old_drive_is_unknown(axisbus, drives):
    simulated_nodes, cell = drives
    assert axisbus("config", "backup", "x", "--cell", cell, "-o", cell.with_name("node-1.dcf")).code == 0
    swap(simulated_nodes)
    code, out, err = axisbus("replace", cell, "x", "--yes")
    assert code == 0, err
    assert "nothing is known about the old drive" in err
    assert f"next: axisbus nameplate {cell} --save" in out
    assert not cell.with_name("cell.nameplate.json").exists()
    assert held(simulated_nodes) == CONFIGURED


def test_ctrl_c_leaves_a_note_and_the_next_run_continues(axisbus, drives, saved, monkeypatch):
    simulated_nodes, cell = drives
    swap(simulated_nodes, 255)

    def interrupted(self: DriveReplacement) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(DriveReplacement, "_store", interrupted)
        code, _, err = axisbus("replace", cell, "x", "--yes")
    assert code == 130
    assert "the replacement of node 1 is unfinished: run the command again to finish it" in err
    assert note_of(cell).exists()
    assert "the replacement of node 1 is unfinished" in axisbus("nameplate", cell, "--saved").err
    code, out, _ = axisbus("replace", cell, "x", "--yes")
    assert code == 0
    assert "its replacement has begun before, and is unfinished" in out
    assert "1. set its node-ID, and let it store that" in out
    assert not note_of(cell).exists()
    assert "unfinished" not in axisbus("nameplate", cell, "--saved").err


def test_a_refused_second_run_keeps_the_note_of_the_first_one(axisbus, drives, saved, monkeypatch):
    simulated_nodes, cell = drives
    swap(simulated_nodes)
    before = _interrupted_run(axisbus, cell, monkeypatch)
    simulated_nodes.devices[0].dials.sdo_aborts[0x6081, 0] = 0x0602_0000
    code, _, err = axisbus("replace", cell, "x", "--yes")
    assert code == 1
    assert "nothing was written" in err
    assert note_of(cell).read_bytes() == before
    assert "the replacement of node 1 is unfinished" in axisbus("nameplate", cell, "--saved").err


def test_a_run_that_is_refused_after_a_write_leaves_a_note(axisbus, drives, saved, monkeypatch):
    simulated_nodes, cell = drives
    swap(simulated_nodes)

    def refused(self: DriveReplacement) -> None:
        raise StateError("the machine is being closed")

    monkeypatch.setattr(DriveReplacement, "_restart", refused)
    code, _, err = axisbus("replace", cell, "x", "--yes")
    assert code == 1
    assert "the replacement of node 1 is unfinished" in err
    assert note_of(cell).exists()


def test_a_record_that_cannot_be_written_leaves_a_note_and_the_next_run_finishes(axisbus, drives, saved):
    simulated_nodes, cell = drives
    swap(simulated_nodes)
    table = cell.with_name("cell.nameplate.md")
    table.unlink()
    table.mkdir()
    code, _, err = axisbus("replace", cell, "x", "--yes")
    assert code == 1
    assert "cell.nameplate.md cannot be written" in err
    assert "the replacement of node 1 is unfinished" in err
    table.rmdir()
    assert axisbus("replace", cell, "x", "--yes").code == 0
    assert serial_in_record(cell) == NEW
    assert not note_of(cell).exists()


def _interrupted_run(axisbus, cell: Path, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """Interrupt a replacement after the values were written; return its note."""

    def interrupted(self: DriveReplacement) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(DriveReplacement, "_store", interrupted)
        assert axisbus("replace", cell, "x", "--yes").code == 130
    return note_of(cell).read_bytes()


@pytest.mark.parametrize(("node", "code", "says"), [("3", 1, "has no node 3"), ("w", 2, "'w' is not a node")])
def test_a_node_that_the_cell_does_not_have_is_refused(axisbus, drives, node, code, says):
    ran = axisbus("replace", drives[1], node)
    assert ran.code == code
    assert says in ran.err


# -- joining a machine ---------------------------------------------------------------------------------------------------------


@OWN_PROCESS
@pytest.mark.timeout(120)
def test_a_drive_is_replaced_in_a_running_machine_by_a_command_that_takes_control(axisbus, tmp_path):
    file = own_cell(tmp_path, more='\n[groups.all]\naxes = ["x"]\n')
    with core_in_threads(), Machine.open(file) as machine:
        device = machine.simulated_node(1).device
        for key, value in CONFIGURED.items():
            device.write(*key, value)
        assert axisbus("nameplate", file, "--save").code == 0
        assert axisbus("config", "backup", "x", "--cell", file, "-o", tmp_path / "node-1.dcf").code == 0
        machine.simulated_node(1).switch_off()
        machine.sleep(4.0)
        machine.simulated_node(1).swap(NEW, 255)
        machine.simulated_node(1).switch_on()
        y = enabled(machine["y"])
        code, _, err = axisbus("replace", file, "x", "--yes")
        assert code == 1
        assert "has control" in err
        handle = under_way(y)
        code, out, err = axisbus("replace", file, "x", "--yes", "--take")
        assert code == 0, err
        assert "joined the running machine" in err
        assert "6. boot it into the running machine" in out
        shown = [line.removeprefix("note: ") for line in err.splitlines() if "node 1: " in line]
        assert shown == [f"node 1: {step.value}" for step in ReplacementStep]
        assert f"next: axisbus reset {file} x" in out
        assert not handle.active  # control was taken, which halts the axes
        assert abs(turns(machine, 2)) < 0.1
        assert machine["y"].state is AxisState.STANDSTILL
        assert machine["x"].state is AxisState.ERRORSTOP
        assert serial_in_record(file) == NEW
        assert {key: device.read(*key) for key in CONFIGURED} == CONFIGURED
        machine["x"].reset().wait(10)
        enabled(machine["x"]).move_relative(1.0).wait(20)
