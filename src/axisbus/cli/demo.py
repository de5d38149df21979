"""``axisbus demo``: a job on the simulated cell, recorded and plotted."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

import click

from axisbus import Recorder, wait
from axisbus.cell.model import SIMULATED, CellConfig
from axisbus.check.run import checked
from axisbus.cli import examples
from axisbus.cli.shared.common import FAILURE, OK, say, say_next, with_page
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import output_option, require_writable, write_whole
from axisbus.cli.shared.recordings import record_option, recorded
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from axisbus.wording import counted

_FAULT = 0x4310  # excess temperature of the drive
_FAULT_BITS = 0x40000  # the module's own bit for it: MOSFET temperature


@dataclass
class DemoResult:
    """The commanded and the reached positions of the axes."""

    start: float = field(default_factory=time.monotonic)
    moves: list[tuple[str, str, float, float, str]] = field(default_factory=list)

    def say(self, text: str) -> None:
        """Print a line with the seconds since the start."""
        say(f"[{time.monotonic() - self.start:5.1f} s] {text}")


@click.command("demo")
@click.argument("cell", type=PATH, required=False)
@output_option("The folder to write into.", default=Path("demo-output"), show_default=True)
@click.option("--plot/--no-plot", default=True, help="Draw motion.png (needs matplotlib).")
@record_option
def command(cell: Path | None, output: Path, plot: bool, record: Path | None) -> int:
    """Demonstrate axisbus on the simulated cell of examples/cell.toml: boot, enable, home, move, move together, fault, reset,
    stop.

    Everything is simulated: no hardware is needed or touched. Writes recording.csv and motion.png. Also writes cell.toml, the
    cell file that was used, unless a file of that name exists.
    """
    path = cell or examples.folder() / "cell.toml"
    _require_simulated(checked(path))
    for name in ("recording.csv", "motion.png", "cell.toml"):
        require_writable(output / name)
    result = DemoResult()
    result.say(f"cell {path} - simulated drives on a virtual CAN bus, at real speed")
    machine = Machine.simulated(path, at_real_speed=True)
    # The recorder of the plot also records the stop.
    with Recorder(machine) as recorder, machine, recorded(machine, record) as recording:
        _job(machine, result)
    result.say("every axis has been halted and disabled, the nodes are pre-operational")
    csv = recorder.write_csv(output / "recording.csv")
    result.say(f"{counted(len(recorder), 'cycle')} recorded in {csv}")
    picture = None
    if plot:
        picture = _draw(recorder, output, result)
    code = _summary(result)
    say_next(f"open {picture or csv}; then axisbus check {cell or _copy(path, output / 'cell.toml')}")
    return recording.code or code


def _copy(temporary: Path, copy: Path) -> Path:
    """Write a copy of the cell file for the user; an existing file is not replaced, as the user may have changed it."""
    if not copy.exists():
        write_whole(copy, temporary.read_bytes())
    return copy


def _require_simulated(cell: CellConfig) -> None:
    """Refuse a cell on hardware before anything is opened."""
    if cell.bus.interface != SIMULATED:
        raise click.UsageError(
            f'{cell.file}: the demo provokes a fault, so it runs on simulated cells only (interface = "sim")'
        )
    if not cell.axes:
        raise click.UsageError(f"{cell.file}: the demo moves axes, and this cell has none")
    if len(cell.driven) < len(cell.axes):
        raise click.UsageError(f"{cell.file}: the demo homes every axis, and a virtual one cannot be homed")


def _job(machine: Machine, result: DemoResult) -> None:
    _report_boot(machine, result)
    names = [axis.name for axis in machine]
    result.say("enable: all axes")
    wait(axis.enable() for axis in machine)
    result.say("home: " + ", ".join(names))
    wait(axis.home() for axis in machine)
    _profile_moves(machine, result)
    _together(machine, result)
    _fault(machine, result)
    result.say("move back to 0, all at once")
    wait(axis.move_absolute(0.0) for axis in machine)
    _note(machine, result, "back", [0.0] * len(names))


def _report_boot(machine: Machine, result: DemoResult) -> None:
    for report in machine.reports:
        for line in report.text().splitlines():
            result.say(line)


def _profile_moves(machine: Machine, result: DemoResult) -> None:
    targets = [60.0, -40.0, 120.0][: len(machine)]
    result.say("profile position: each axis separately")
    wait(axis.move_absolute(target) for axis, target in zip(machine, targets, strict=False))
    _note(machine, result, "profile position", targets)


def _together(machine: Machine, result: DemoResult) -> None:
    ends = [-30.0, 45.0, 30.0][: len(machine)]
    result.say("cyclic synchronous position: all on one straight line, a target with every SYNC")
    machine.group(*(axis.name for axis in machine)).move_linear(ends, velocity=150.0).wait()
    _note(machine, result, "straight line (csp)", ends)


def _fault(machine: Machine, result: DemoResult) -> None:
    """Provoke a fault during a move, wait for its explanation, reset, and continue."""
    axes = list(machine)
    faulted = axes[1 % len(axes)]
    result.say(f"a fault is provoked in {faulted.name} while all move")
    handles = [axis.move_relative(60.0 if axis is not faulted else -40.0, velocity=40.0) for axis in axes]
    machine.sleep(0.6)
    machine.simulated_node(machine.cell.axes[faulted.name].node).fault(_FAULT, _FAULT_BITS)
    try:
        wait(handles)
    except ExceptionGroup as group:
        for error in group.exceptions:
            result.say(with_page(error).replace("\n", "\n          "))
    machine.sleep(0.4)  # the others brake to standstill
    result.say("states: " + ", ".join(f"{axis.name} {axis.state.value}" for axis in axes))
    result.say(f"reset and enable {faulted.name}; its position was not lost")
    faulted.reset().wait()
    faulted.enable().wait()


def _note(machine: Machine, result: DemoResult, what: str, targets: list[float]) -> None:
    for axis, target in zip(machine, targets, strict=False):
        result.moves.append((what, axis.name, target, axis.position, axis.unit))


def _draw(recorder: Recorder, output: Path, result: DemoResult) -> Path | None:
    """Plot the recording; return the path of the plot, None if there is none."""
    from axisbus.record.plot import plot

    try:
        picture = plot(recorder, output / "motion.png", "axisbus demo: three simulated axes")
    except AxisbusError as error:
        result.say(f"no picture: {error}")
        return None
    result.say(f"picture: {picture}")
    return picture


def _summary(result: DemoResult) -> int:
    say()
    say(f"{'move':<22}{'axis':<6}{'commanded':>12}{'reached':>12}")
    for what, axis, target, reached, unit in result.moves:
        say(f"{what:<22}{axis:<6}{target:>12.3f}{reached:>12.3f} {unit}")
    off = [axis for _, axis, target, reached, _ in result.moves if abs(target - reached) > 0.5]
    if off:
        say(f"NOT as commanded: {', '.join(off)}")
    return FAILURE if off else OK
