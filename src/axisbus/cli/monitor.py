"""``axisbus monitor``: states, positions and faults of a cell's axes, line by line."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cia402 import statusword
from axisbus.cia402.modes import ModeOfOperation, short
from axisbus.cli.common import OK, say, say_json, say_next
from axisbus.machine.machine import Machine
from axisbus.motion.axis import Axis


@click.command("monitor")
@click.argument("cell", type=click.Path(path_type=Path))
@click.option("--every", default=1.0, show_default=True, help="Seconds between two looks.")
@click.option("--count", type=int, help="How many looks; without, until Ctrl-C.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON value per look.")
def command(cell: Path, every: float, count: int | None, as_json: bool) -> int:
    """Boot CELL and show its axes; energises nothing."""
    with Machine.open(cell) as machine:
        looks = 0
        while True:
            _look(machine, as_json)
            looks += 1
            if count is not None and looks >= count:
                break
            machine.sleep(every)
    if not as_json:
        say_next(f"axisbus home {cell}, or axisbus move {cell} {next(iter(machine)).name}=...")
    return OK


def _look(machine: Machine, as_json: bool) -> None:
    if as_json:
        say_json([describe(axis) for axis in machine])
        return
    for axis in machine:
        seen = describe(axis)
        say(
            f"{seen['axis']:<8} {seen['state']:<18} {_number(seen['position'], axis.unit):>20} "
            f"{_number(seen['velocity'], axis.unit + '/s'):>20}  {seen['power']}, {seen['mode']}  {seen['bits']}"
        )
        if seen["error"]:
            say("         " + str(seen["error"]).replace("\n", "\n         "))


def describe(axis: Axis) -> dict[str, object]:
    """Return an axis's present values as plain ones; what is unknown is None."""
    snapshot = axis.snapshot
    mode = None if snapshot.mode is None else ModeOfOperation(snapshot.mode)
    return {
        "axis": axis.name,
        "state": snapshot.state.value,
        "position": None if snapshot.position is None else axis.position,
        "velocity": None if snapshot.velocity is None else axis.velocity,
        "unit": axis.unit,
        "power": snapshot.power.value,
        "mode": "mode unknown" if mode is None else short(mode),
        "bits": ""
        if snapshot.statusword is None
        else ", ".join(statusword.bit_words(snapshot.statusword, mode)),
        "error": None if snapshot.error is None else str(snapshot.error),
    }


def _number(value: object, unit: str) -> str:
    return "unknown" if not isinstance(value, float) else f"{value:.3f} {unit}"
