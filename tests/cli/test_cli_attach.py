"""Commands beside a program that moves an axis: each joins its machine or is refused with the reason, and only a stop stops it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from axisbus.cia301.nmt import NmtState
from axisbus.cli.shared import enabled_axes
from axisbus.errors import Stopped
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.cell import cell_file
from kit.core_in_threads import core_in_threads
from kit.scenarios.core_process import OWN_PROCESS, enabled, own_cell, turns

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return own_cell(tmp_path_factory.mktemp("joined"), axis="rated_torque = 10.0\nmax_torque = 5.0")


@pytest.fixture(scope="module")
def opened(file):
    with core_in_threads(), Machine.open(file) as machine:
        yield machine


def test_monitor_joins_and_looks_on(axisbus, moving, file):
    machine, handle = moving
    code, out, err = axisbus("monitor", file, "--count", "1")
    assert code == 0
    assert "DiscreteMotion" in out
    assert "joined the running machine" in err
    assert handle.active
    assert abs(turns(machine)) == pytest.approx(30.0, abs=1.0)


@pytest.mark.parametrize(
    "words",
    [
        ("enable",),
        ("disable",),
        ("home",),
        ("reset",),
        ("move", "y=1"),
        ("move", "x=0"),
        ("enable", "y"),
        ("velocity", "y=5", "--for", "1"),
        ("torque", "y=0.1", "--for", "1"),
    ],
    ids=" ".join,
)
def test_a_command_without_control_is_refused_and_names_the_owner(axisbus, moving, file, words):
    machine, handle = moving
    code, _, err = axisbus(words[0], file, *words[1:])
    assert code == 1
    assert "has control" in err
    assert "--take" in err
    assert handle.active
    assert abs(turns(machine)) == pytest.approx(30.0, abs=1.0)


@pytest.mark.parametrize("words", [("halt",), ("halt", "x"), ("stop",)], ids=" ".join)
def test_any_client_may_halt_and_stop_and_the_program_continues(axisbus, moving, file, words):
    machine, handle = moving
    code, out, _ = axisbus(words[0], file, *words[1:])
    assert code == 0
    assert "stands" in out
    assert turns(machine) == pytest.approx(0.0, abs=0.1)
    with pytest.raises(Stopped, match="by process"):
        handle.wait(10)
    machine["x"].enable().wait(20)
    machine["x"].move_relative(1.0).wait(20)


def test_with_take_control_belongs_to_the_command_until_it_ends(axisbus, moving, file):
    machine, handle = moving
    code, out, _ = axisbus("move", file, "y=5", "--take")
    assert code == 0
    assert "y: at 5.0" in out
    assert "those that were enabled before are still enabled" in out
    with pytest.raises(Stopped, match="took control"):
        handle.wait(10)
    assert machine["y"].state is AxisState.DISABLED
    machine["x"].move_relative(1.0).wait(20)


@pytest.mark.parametrize("verb", ["enable", "disable", "halt"])
def test_without_a_machine_halt_and_similar_commands_are_refused(axisbus, tmp_path, verb):
    path = cell_file(tmp_path, "x")
    code, _, err = axisbus(verb, path)
    assert code == 1
    assert f"no machine of {path} is running on this computer, and {verb} " in err
    assert "a machine that is just starting can be joined after it has booted" in err


def test_a_second_interrupt_while_axes_are_disabled_again_is_reported(monkeypatch, capsys):
    """The first one has ended the command; the axes that it had enabled may still be enabled."""

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(Machine, "try_attach", interrupted)
    with pytest.raises(KeyboardInterrupt):
        enabled_axes._disable_again(Path("cell.toml"), ["x", "y"])
    assert "check x, y: it is not known whether it is enabled (interrupted)" in capsys.readouterr().err


def test_a_machine_whose_core_is_in_the_program_cannot_be_shared(axisbus, tmp_path):
    path = cell_file(tmp_path, "x", bus='process = "thread"')
    code, _, err = axisbus("run", path)
    assert code == 1
    assert "cannot be shared" in err


# -- nodes and their objects -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (("od", "read", "x:6041", "1:6064"), "operation enabled"),
        (("od", "watch", "x:6064", "--every", "0.05", "--count", "3"), "node 1"),
        (("od", "dump", "y"), "Statusword"),
        (("config", "diff", "y"), "compared"),
    ],
    ids=lambda each: " ".join(each[:2]) if isinstance(each, tuple) else "",
)
def test_a_reading_command_joins_and_the_motion_continues(axisbus, moving, file, words, shown):
    machine, handle = moving
    code, out, err = axisbus(*words, "--cell", file)
    assert code == (1 if words[:2] == ("config", "diff") else 0), out + err
    assert shown in out
    assert "joined the running machine" in err
    assert handle.active
    assert abs(turns(machine)) == pytest.approx(30.0, abs=1.0)


def test_a_value_that_is_read_is_the_one_of_the_running_drive(axisbus, moving, file):
    machine, _ = moving
    assert machine.simulated_node(1).drive().axis.motor.velocity != 0.0
    code, out, _ = axisbus("od", "read", "x:606C", "--cell", file, "--json")
    assert code == 0
    assert json.loads(out)[0]["value"] != 0


def test_a_backup_is_of_the_running_drive(axisbus, moving, file, tmp_path):
    code, _, err = axisbus("config", "backup", "y", "--cell", file, "-o", str(tmp_path / "y.dcf"))
    assert code == 0, err
    assert b"[6064]" in (tmp_path / "y.dcf").read_bytes()
    code, _, err = axisbus("config", "restore", str(tmp_path / "y.dcf"), "y", "--cell", file)
    assert code == 1
    assert "cannot join it" in err
    assert moving[1].active


@pytest.mark.parametrize(
    "words",
    [
        ("od", "write", "y:6081", "1000"),
        ("od", "write", "x:607D:1", "5"),
        ("nmt", "stop", "y"),
        ("nmt", "reset-node", "all", "--force"),
    ],
    ids=" ".join,
)
def test_a_command_that_would_change_a_node_is_refused_and_names_the_owner(axisbus, moving, file, words):
    machine, handle = moving
    code, _, err = axisbus(*words, "--cell", file)
    assert code == 1
    assert "has control" in err
    assert handle.active
    assert abs(turns(machine)) == pytest.approx(30.0, abs=1.0)


@pytest.mark.parametrize(
    "words",
    [
        ("save", "y"),
        ("scan",),
    ],
    ids=lambda words: words[0],
)
def test_a_command_that_needs_the_bus_alone_is_refused_with_the_reason(axisbus, moving, file, words):
    code, _, err = axisbus(*words, *([str(file)] if words == ("scan",) else ["--cell", file]))
    assert code == 1
    assert "cannot join it" in err
    assert moving[1].active


def test_taken_a_node_is_set_and_commanded_by_the_running_core(axisbus, opened, file):
    for axis in opened:
        axis.disable().wait(20)
    code, out, _ = axisbus("od", "write", "y:6083", "20000", "--cell", file, "--take")
    assert code == 0, out
    assert "read back" in out
    assert opened.node(2).sdo[0x6083] == 20000
    code, out, err = axisbus("od", "write", "y:6040", "6", "--cell", file, "--take", "--may-move")
    assert code == 1
    assert "only the commands of the running machine" in err or "sent by PDO" in err
    code, out, err = axisbus("nmt", "pre-operational", "y", "--cell", file, "--take")
    assert code == 0, err
    assert out == "node 2: pre-operational (was operational)\n"
    assert opened.node(2).nmt is NmtState.PRE_OPERATIONAL
    assert (
        axisbus("nmt", "start", "y", "--cell", file, "--take").out
        == "node 2: operational (was pre-operational)\n"
    )
    opened["y"].reset().wait(20)
    assert opened["y"].state is AxisState.DISABLED


def test_a_node_that_is_energised_is_taken_from_the_bus_by_force_alone(axisbus, moving, file):
    machine, _ = moving
    code, _, err = axisbus("nmt", "stop", "x", "--cell", file, "--take")
    assert code == 1
    assert "is energised; nothing was sent" in err
    assert machine.node(1).nmt is NmtState.OPERATIONAL


def test_a_node_that_has_lost_its_supply_is_booted_in_the_running_machine(axisbus, opened, file):
    for axis in opened:
        axis.disable().wait(20)
    node = opened.simulated_node(2)
    node.switch_off()
    opened.sleep(1.0)
    code, out, _ = axisbus("boot", file, "--node", "2", "--take")
    assert code == 3
    assert "FAILED at find: " in out
    assert f"boot the node again: axisbus boot {file} --node 2" in out
    node.switch_on()
    opened.sleep(1.0)
    code, out, _ = axisbus("boot", file, "--node", "2")
    assert code == 1
    code, out, _ = axisbus("boot", file, "--node", "2", "--take")
    assert code == 0
    assert "written and read back" in out
    assert f"next: axisbus reset {file} y" in out
    assert opened["y"].error is not None
    assert "was booted again" in opened["y"].error.message
    assert axisbus("reset", file, "y", "--take").code == 0
    enabled(opened["y"]).move_relative(1.0).wait(20)


def test_a_program_boots_a_node_of_its_core(opened):
    for axis in opened:
        axis.disable().wait(20)
    parts = opened.node(2).parts
    steps: list[str] = []
    assert opened.node(2).boot(steps.append).ok
    assert (steps[0], steps[-1], len(steps)) == ("find", "start", 10)
    assert opened.node(2).parts is not parts
    opened["y"].reset().wait(20)
    enabled(opened["y"]).move_relative(1.0).wait(20)


def test_boot_of_a_node_without_a_machine_names_the_command_for_all(axisbus, tmp_path):
    file = own_cell(tmp_path)
    code, _, err = axisbus("boot", file, "--node", "1")
    assert code == 1
    assert f"to boot all nodes: axisbus boot {file}" in err


def test_nameplates_are_saved_and_a_swapped_drive_is_named(axisbus, opened, file):
    for axis in opened:
        axis.disable().wait(20)
    code, out, _ = axisbus("nameplate", file, "--compare")
    assert code == 1
    code, out, _ = axisbus("nameplate", file, "--save")
    assert code == 0
    assert "EDS or DCF of the cell file" in out
    record = file.with_name("cell.nameplate.json")
    assert [node["node"] for node in json.loads(record.read_text("utf-8"))["nodes"]] == [1, 2]
    assert "## Node 2" in record.with_suffix(".md").read_text("utf-8")
    assert axisbus("nameplate", file, "--saved").out.startswith("saved 20")
    assert axisbus("nameplate", file, "--compare").out == "2 nodes compared, nothing has changed\n"
    drive = opened.simulated_node(2).device
    before = drive.dictionary.get_int(0x1018, 4)
    drive.dictionary.set(0x1018 << 8 | 4, before + 1)
    code, out, _ = axisbus("nameplate", file, "--compare")
    assert code == 1
    assert (
        out
        == f"node 2: serial number (1018h:04) was 0x{before:X} ({before}), is 0x{before + 1:X} ({before + 1})\n"
    )
    drive.dials.dead = True
    code, out, err = axisbus("nameplate", file, "--save")
    assert code == 3
    assert "node 2 does not answer" in err
    drive.dials.dead = False
    assert json.loads(record.read_text("utf-8"))["nodes"][1]["serial"] == before
    drive.dictionary.set(0x1018 << 8 | 4, before)
    opened.sleep(1.0)
    assert opened.node(2).boot().ok
    opened["y"].reset().wait(20)
