"""``axisbus home``: enable axes and home them."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.check.run import checked
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.attach_or_open import take_option
from axisbus.cli.shared.axes_and_pairs import as_pairs, movers
from axisbus.cli.shared.common import say_next
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.enabled_axes import commanded, enable
from axisbus.cli.shared.enabled_axes import home as find_home
from axisbus.cli.shared.options import beside_option
from axisbus.cli.shared.paths import PATH
from axisbus.cli.shared.recordings import record_option, recorded
from axisbus.machine.dry_run import DryRun


@click.command("home")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
@record_option
@beside_option
@take_option
def command(cell: Path, axes: tuple[str, ...], record: Path | None, beside: bool, take: bool) -> int:
    """Boot CELL, enable its axes (or the named axes, groups or pairs), home them as their homing tables say, stop and disable
    them.

    MOVES REAL MOTORS, unless the homing method takes the present position. Ctrl-C halts them.
    """
    config = checked(cell)
    axes_of_all = named.driven(config, axes)
    names = as_pairs(config, axes_of_all, "home")

    def rehearse() -> None:  # report impossible requests before the bus is opened
        for each in movers(DryRun(config), names):
            each.home()

    with (
        commanded(cell, axes_of_all, take=take, beside=beside, before=rehearse) as (machine, _),
        recorded(machine, record) as recording,
    ):
        chosen = movers(machine, names)
        enable(chosen)
        find_home(machine, chosen)
    say_next(f"axisbus move {cell} {names[0]}=... --home")
    return recording.code
