"""``axisbus replace`` in one terminal and ``axisbus sim`` in another: killed after each of its steps, and run again."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from axisbus import SimulationControl
from axisbus.configuration.replacement_order import ReplacementStep
from kit import command_line
from kit.cell import cell_file

pytestmark = [
    pytest.mark.skipif(
        sys.platform != "linux", reason="the simulated drives are controlled by a Unix socket"
    ),
    pytest.mark.timeout(240),
]
OLD = 4711
VELOCITY = 123_456  # 6081h, which no cell file sets
SWAP = """
[spare]
node = 1
begin = "0ms"
swap = { serial = 4711 }
"""


def run(*arguments: object) -> command_line.Result:
    with command_line.started(*arguments) as process:
        out, err = process.communicate()
    return command_line.Result(process.returncode, out, err)


@pytest.fixture(scope="module")
def served(tmp_path_factory) -> Iterator[tuple[Path, SimulationControl]]:
    """A cell whose drives another process simulates; node 1 has been recorded, configured and backed up."""
    folder = tmp_path_factory.mktemp("replace")
    mine, control = folder / "mine.toml", folder / "plant.sock"
    (folder / "swap.toml").write_text(SWAP, encoding="utf-8")
    options = ("-o", mine, "--control", control, "--faults", folder / "swap.toml")
    with command_line.simulating(cell_file(folder, "xy"), *options) as sim:
        command_line.lines_before(sim, "spare")
        with SimulationControl(control) as plant:
            command_line.until(lambda: plant.simulated_node(1).device.answers_sdo)
            plant.simulated_node(1).device.write(0x6081, 0, VELOCITY)
            saved = run("nameplate", mine, "--save")
            assert saved.code == 0, saved.err
            assert serial_in_record(mine) == OLD
            backup = run("config", "backup", "x", "--cell", mine, "-o", folder / "node-1.dcf")
            assert backup.code == 0, backup.err
            yield mine, plant


def serial_in_record(cell: Path) -> int:
    record = json.loads(cell.with_name("mine.nameplate.json").read_text(encoding="utf-8"))
    return next(each["serial"] for each in record["nodes"] if each["node"] == 1)


STEPS = [step for step in ReplacementStep if step is not ReplacementStep.BOOT]


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.name)
def test_a_command_that_is_killed_as_a_step_begins_is_run_again(served, step):
    mine, plant = served
    drive, new = plant.simulated_node(1), 5000 + STEPS.index(step)
    drive.switch_off()
    drive.swap(new, node_id=255)
    drive.switch_on()
    with command_line.started("replace", mine, "x", "--yes") as killed:
        told = []
        while not (line := killed.stderr.readline()).startswith(f"node 1: {step.value}"):
            told.append(line)
            assert line, told
        killed.kill()
    before = serial_in_record(mine)
    again = run("replace", mine, "x", "--yes")
    if (
        step is ReplacementStep.RECORD and before == new
    ):  # the last step had ended when the command was killed
        assert again.code in (0, 1)
    else:
        assert before != new
        assert again.code == 0, again.err
        assert "has begun before, and is unfinished" in again.out
    assert serial_in_record(mine) == new
    drive.switch_off()
    drive.switch_on()
    command_line.until(lambda: drive.device.answers_sdo)
    assert drive.device.node_id == 1
    assert drive.device.read(0x6081) == VELOCITY
    assert not mine.with_name("mine.replacement-1.json").exists()
    assert run("boot", mine).code == 0
