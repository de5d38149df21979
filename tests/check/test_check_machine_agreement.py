"""Errors of ``check`` are refused by the machine, and commands that the machine can run pass ``check``: over every makers' file.

Each file makes a simulated drive; each command is given to it in virtual time. The machine is judged by the plant.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from axisbus.check.run import check
from axisbus.errors import AxisbusError, StaleError, UserError
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit import cells
from kit.campaign.cells.files import motor_of
from kit.corpus import CORPUS

CHECKOUT = Path(__file__).parents[2]
CELL = """\
[bus]
interface = "sim"
scan_period = "10ms"
heartbeat = "off"
[nodes.1]
eds = '{file}'
remap = "{remap}"
[axes.x]
node = 1
unit = "increments"
velocity_scale = {counts!r}
acceleration_scale = {counts!r}
rated_torque = 1.0
{axis}
[axes.x.defaults]
velocity = {velocity}
acceleration = 2000.0
[axes.x.homing]
required = false
{homing}
"""
_PARTS = 8
SPEEDS = "speed_switch = 100.0\nspeed_zero = 50.0\n"
# The mode of a command, its requirement in the cell file, and the command.
COMMANDS = {
    "pp": ("pp", "", lambda x: x.move_relative(200.0, timeout=8.0)),
    "pv": ("pv", "", lambda x: x.move_velocity(500.0)),
    "tq": ("tq", "", lambda x: x.torque_control(0.01)),
    "hm on the spot": ("hm", "method = 35\n", lambda x: x.home(35)),
    "hm of the maker": ("hm", "method = -1\n", lambda x: x.home(-1)),
    "hm with a search": ("hm", f"method = 17\n{SPEEDS}", lambda x: x.home(17, timeout=2.0)),
    "csp": ("csp", "", lambda x: x.follow(TrapezoidalTrajectory(here(x), here(x) + 100.0, 500.0, 2000.0))),
}


def here(x: Axis) -> float:
    try:
        return x.position
    except StaleError:
        return 0.0  # a drive without 6064h


def corpus_files() -> list[Path]:
    manifest = CORPUS / "manifest.tsv"
    if not manifest.is_file():
        return []
    rows = csv.DictReader(manifest.read_text(encoding="utf-8").splitlines(), delimiter="\t")
    return [CORPUS / row["file"] for row in rows if row["profile"] == "402"]


def written(folder: Path, file: Path, **changes: str) -> Path:
    values = {"remap": "auto", "axis": "", "homing": "", "velocity": "500.0"} | changes
    values["counts"] = motor_of(file.name)[1]
    path = folder / "cell.toml"
    path.write_text(CELL.format(file=file, **values), encoding="utf-8")
    return path


def errors_of(path: Path) -> set[str]:
    return {problem.message for problem in check(path) if problem.severity.value == "error"}


def verdicts(folder: Path, file: Path) -> dict[str, set[str]]:
    """The errors that ``check`` has of each command, beside those that the file has anyhow."""
    always = errors_of(written(folder, file, axis='modes = ["ip"]')) & errors_of(written(folder, file))
    return {
        name: errors_of(written(folder, file, axis=f'modes = ["{mode}"]', homing=homing)) - always
        for name, (mode, homing, _) in COMMANDS.items()
    }


def tried(machine: Machine, command: Callable[[Axis], Handle]) -> AxisbusError | None:
    """Give a command to an axis at standstill; return its end."""
    x = machine["x"]
    try:
        if x.error is not None:
            x.reset().wait(5)
        x.enable().wait(10)
        handle = command(x)
        with suppress(TimeoutError):  # it continues: it was accepted
            handle.wait(30)
        x.halt().wait(5)
    except AxisbusError as error:
        return error
    return None


def outcomes(folder: Path, file: Path) -> dict[str, AxisbusError | None] | None:
    """The result of each command; None if no machine can be made, or the drive cannot be enabled."""
    found: dict[str, AxisbusError | None] = {}
    for name, (_, homing, command) in COMMANDS.items():
        try:
            machine = Machine.simulated(written(folder, file, homing=SPEEDS if SPEEDS in homing else ""))
        except AxisbusError:
            return None
        try:
            machine["x"].enable().wait(10)
            found[name] = tried(machine, command)
        finally:
            with suppress(AxisbusError, ExceptionGroup):  # the result of the command is known already
                machine.close()
    return found


def disagreements(folder: Path, file: Path, seen: Counter[str]) -> list[str]:
    said = verdicts(folder, file)
    try:
        done = outcomes(folder, file)
    except AxisbusError:
        done = None  # it cannot be enabled: its modes are unknown
    if done is None:
        seen["no machine"] += 1
        return []
    wrong = []
    for name, error in done.items():
        seen[
            f"{name}: {'runs' if error is None else type(error).__name__}{', check error' if said[name] else ''}"
        ] += 1
        if said[name] and not isinstance(error, UserError):
            wrong.append(f"{file.name}: {name}: check says {said[name]}, the machine {error!r}")
    return wrong


@pytest.mark.skipif(not corpus_files(), reason="the collection of makers' files is not here")
@pytest.mark.parametrize("part", range(_PARTS))
@pytest.mark.timeout(300)
def test_check_and_machine_agree_on_every_makers_file(tmp_path: Path, part: int) -> None:
    seen: Counter[str] = Counter()
    wrong = [line for file in corpus_files()[part::_PARTS] for line in disagreements(tmp_path, file, seen)]
    assert wrong == []
    assert seen["pp: runs"] > 3, seen


def test_check_and_machine_agree_on_the_built_in_files(tmp_path: Path) -> None:
    seen: Counter[str] = Counter()
    for file in sorted((CHECKOUT / "eds").glob("*cia402.eds")) + sorted((CHECKOUT / "eds").glob("gim*.eds")):
        assert disagreements(tmp_path, file, seen) == []
    assert seen["no machine"] == 0


@pytest.mark.parametrize("index", ["607A", "6081", "6083", "60FF", "6087", "6071", "6098", "6099", "6064"])
def test_check_and_machine_agree_on_a_drive_that_lacks_an_object(tmp_path: Path, index: str) -> None:
    file = tmp_path / "drive.eds"
    # It sends none of it either: an object that a drive maps exists, though its file lacks it.
    text = cells.without(index)(cells.DRIVE).replace("=0x60640020", "=0x606C0020")
    file.write_text(text, encoding="ascii")
    seen: Counter[str] = Counter()
    assert disagreements(tmp_path, file, seen) == []
    assert seen["no machine"] == 0
