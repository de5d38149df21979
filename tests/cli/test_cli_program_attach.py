"""``axisbus program`` beside a program that runs the machine: its core writes, and continues if the command ends."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from axisbus.cli.program import _Announced
from axisbus.errors import ArgumentError
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.sim.boot_loader import ProgramLoader
from kit.cell import cell_file
from kit.core_in_threads import core_in_threads
from kit.eds.loader import loader_eds, program
from kit.scenarios.core_process import OWN_PROCESS, enabled, turns, under_way

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
NEW, NEWER = (15_400, 43_200_000), (15_401, 0)


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("joined")
    return cell_file(
        folder, "xy", period="20ms", heartbeat="1s", bus='process = "own"', eds=loader_eds(folder)
    )


@pytest.fixture(scope="module")
def opened(file) -> Iterator[Machine]:
    with core_in_threads(), Machine.open(file) as machine:
        yield machine


@pytest.fixture
def firmware(tmp_path) -> Path:
    return image(tmp_path, NEW)


def image(folder: Path, version: tuple[int, int], size: int = 3000) -> Path:
    path = folder / "firmware.bin"
    path.write_bytes(program(version, size))
    return path


def loader(machine: Machine) -> ProgramLoader:
    found = machine.simulated_node(2).device.loader
    assert found is not None
    return found


def at_rest(machine: Machine) -> None:
    """Have y disabled."""
    if machine["y"].state is not AxisState.ERRORSTOP:
        machine["y"].disable().wait(20)


def boot(axisbus, file: Path) -> None:
    assert axisbus("boot", file, "--node", "2", "--take").code == 0
    assert axisbus("reset", file, "y", "--take").code == 0


def test_show_needs_no_control(axisbus, opened, file):
    x = enabled(opened["x"])
    handle = under_way(x)
    code, out, err = axisbus("program", "show", "y", "--cell", file)
    assert code == 0
    assert "joined the running machine" in err
    assert "  program 1 (1F51h)             runs\n" in out
    assert handle.active
    x.halt().wait(10)


def test_write_needs_control(axisbus, opened, file, firmware):
    code, _, err = axisbus("program", "write", firmware, "y", "--cell", file, "--raw")
    assert code == 1
    assert "--take" in err
    assert loader(opened).orders == []


def test_the_core_writes_and_the_node_is_booted_afterwards(axisbus, opened, file, firmware):
    at_rest(opened)
    code, out, err = axisbus("program", "write", firmware, "y", "--cell", file, "--raw", "--take")
    assert code == 0, err
    assert loader(opened).program == firmware.read_bytes()
    assert "node 2: its program is being replaced; do not switch it off\n" in err
    assert f"next: boot the node: axisbus boot {file} --node 2" in out
    assert "node 2 has a new program" in str(opened["y"].error)
    code, out, _ = axisbus("program", "verify", firmware, "2", "--cell", file, "--raw", "--json")
    assert (code, json.loads(out)["same"]) == (0, True)
    boot(axisbus, file)
    enabled(opened["y"]).move_relative(1.0).wait(20)


def test_a_program_that_is_longer_than_a_message_arrives_whole(axisbus, opened, file, tmp_path):
    at_rest(opened)
    firmware = image(tmp_path, NEWER, 200_001)
    assert axisbus("program", "write", firmware, "y", "--cell", file, "--raw", "--take").code == 0
    assert loader(opened).program == firmware.read_bytes()
    boot(axisbus, file)


def test_an_enabled_axis_is_refused(axisbus, opened, file, firmware):
    enabled(opened["y"])
    before = list(loader(opened).orders)
    code, _, err = axisbus("program", "write", firmware, "y", "--cell", file, "--raw", "--take")
    assert code == 1
    assert "the program of node 2 cannot be written now" in err
    assert loader(opened).orders == before
    assert opened["y"].error is None
    at_rest(opened)


def test_the_error_of_a_failed_write_reaches_the_command(axisbus, opened, file, firmware):
    at_rest(opened)
    dials = opened.simulated_node(2).device.dials
    dials.program.flash_error = 5
    code, _, err = axisbus("program", "write", firmware, "y", "--cell", file, "--raw", "--take")
    assert code == 3
    assert "error 5: its memory could not be written" in err
    dials.program.flash_error = 0
    assert axisbus("program", "write", firmware, "y", "--cell", file, "--raw", "--take").code == 0
    boot(axisbus, file)


def test_if_the_command_is_ended_the_core_continues(axisbus, opened, file, tmp_path, monkeypatch):
    at_rest(opened)
    firmware = image(tmp_path, NEWER)
    opened.simulated_node(2).device.dials.program.flash_time = 5.0

    def interrupt(_self: object, _done: int, _total: int | None) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(_Announced, "__call__", interrupt)
        code, _, err = axisbus("program", "write", firmware, "y", "--cell", file, "--raw", "--take")
    assert code == 130
    assert "the core of the machine goes on writing the program of node 2; do not switch it off" in err
    code, _, err = axisbus("program", "write", firmware, "y", "--cell", file, "--raw", "--take")
    assert code == 1
    assert "another program is being written into it" in err
    before = list(loader(opened).orders)
    for words in (["nmt", "reset-node", "y"], ["od", "write", "y", "0x6081", "100"]):
        code, _, err = axisbus(*words, "--cell", file, "--take")
        assert code == 1
        assert "the node is being booted, or its program is being written" in err
    assert loader(opened).orders == before
    for _ in range(600):
        if "has a new program" in str(opened["y"].error):
            break
        opened.sleep(0.1)
    assert loader(opened).program == firmware.read_bytes()
    opened.simulated_node(2).device.dials.program.flash_time = 0.0
    boot(axisbus, file)


def test_an_empty_program_is_refused_and_clears_nothing(opened):
    at_rest(opened)
    before = list(loader(opened).orders)
    with pytest.raises(ArgumentError, match="is empty"):
        opened.node(2).write_program(b"")
    assert loader(opened).orders == before


def test_the_program_that_opened_the_machine_writes_by_a_call(opened, tmp_path):
    at_rest(opened)
    x = enabled(opened["x"])
    handle = under_way(x)
    told = list[tuple[int, int | None]]()
    data = program(NEW)
    written = opened.node(2).write_program(data, progress=lambda *facts: told.append(facts))
    assert (written.before.version, written.after.version, written.size) == (NEWER, NEW, 3000)
    assert told[-1] == (3000, 3000)
    assert handle.active
    assert abs(turns(opened)) == pytest.approx(30.0, abs=1.0)
    assert opened.node(2).boot().ok
    opened["y"].reset().wait(20)
    x.halt().wait(10)
