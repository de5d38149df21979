"""``axisbus run``: keep a cell's machine running, so that other programs and commands can join it."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.monitor.axes import every_option, pace, watch
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.options import PATH, Seconds, beside_option
from axisbus.machine.machine import Machine


@click.command("run")
@click.argument("cell", type=PATH)
@every_option
@click.option("--for", "seconds", type=Seconds(), help="Duration in seconds; without it, until Ctrl-C.")
@beside_option
def command(cell: Path, every: float | None, seconds: float | None, beside: bool) -> int:
    """Boot CELL, keep its machine running, and show its axes; energises nothing unless a client commands it.

    Meanwhile other terminals and programs of this user can join it: axisbus monitor, enable, move, home, halt, stop, and
    Machine.attach. One of them has control at a time; all may halt and stop. Ctrl-C stops every axis, disables it, and ends the
    machine.
    """
    step = pace(every)
    with Machine.open(cell, allow_other_master=beside, shared=True) as machine:
        say(f"the machine runs ({machine.real_time_status}); in another terminal:")
        for text in (f"axisbus monitor {cell}", f"axisbus move {cell} {next(iter(machine)).name}=..."):
            say(f"  {text}")
        watch(machine, step, None if seconds is None else max(1, round(seconds / step)), as_json=False)
    return OK
