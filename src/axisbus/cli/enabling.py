"""The commands that enable, home and disable axes, and reset faults."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus import wait
from axisbus.check.run import checked
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.attach_or_open import machine_of, running, take_option
from axisbus.cli.shared.axes_and_pairs import all_axes, as_pairs, movers
from axisbus.cli.shared.common import OK, say, say_next, with_page
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.enabled_axes import MotionOptions, commanded, enable, motion_options, say_state
from axisbus.cli.shared.enabled_axes import home as find_home
from axisbus.cli.shared.options import PATH, beside_option
from axisbus.cli.shared.recordings import recorded
from axisbus.machine.dry_run import DryRun

# -- ``axisbus enable``: enable axes of a running machine --------------------------------------------------------------


@click.command("enable")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
@take_option
def enable_command(cell: Path, axes: tuple[str, ...], take: bool) -> int:
    """Enable the axes of CELL, or the named axes, groups or pairs, in the running machine; they stay enabled.

    ENERGISES MOTORS. It needs a machine that keeps running: axisbus run CELL, or your own program.
    """
    config = checked(cell)
    names = as_pairs(config, named.chosen(config, axes), "enable")
    why, remedy = (
        "lasts only as long as the machine runs",
        f"start one in another terminal: axisbus run {cell}",
    )
    with running(cell, "enable", why, remedy, command=True, take=take) as machine:
        enable(movers(machine, names))
    say_next(f"axisbus move {cell} {names[0]}=..., or axisbus disable {cell}")
    return OK


# -- ``axisbus home``: enable axes and home them -----------------------------------------------------------------------


@click.command("home")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
@motion_options
def home_command(cell: Path, axes: tuple[str, ...], how: MotionOptions) -> int:
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
        commanded(cell, axes_of_all, how, rehearse) as (machine, _),
        recorded(machine, how.record) as recording,
    ):
        chosen = movers(machine, names)
        enable(chosen)
        find_home(machine, chosen)
    say_next(f"axisbus move {cell} {names[0]}=... --home")
    return recording.code


# -- ``axisbus reset``: reset faults -----------------------------------------------------------------------------------


@click.command("reset")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
@beside_option
@take_option
def reset_command(cell: Path, axes: tuple[str, ...], beside: bool, take: bool) -> int:
    """Boot CELL and reset the faults of its axes (or of the named axes, groups or pairs); enables nothing.

    Each fault is shown before it is reset. Exit code 3 when a fault remains.
    """
    config = checked(cell)
    names = as_pairs(config, named.chosen(config, axes))
    with machine_of(cell, command=True, take=take, beside=beside) as machine:
        machine.sleep(0.5)  # wait for the details of the fault by SDO
        chosen = movers(machine, names)
        for axis in all_axes(chosen):
            error_text = "no fault" if axis.error is None else with_page(axis.error)
            say(error_text if error_text.startswith(f"{axis.name}: ") else f"{axis.name}: {error_text}")
        wait([each.reset() for each in chosen])
        for each in chosen:
            say_state(each)
    say_next(f"axisbus home {cell}, or axisbus move {cell} {names[0]}=...")
    return OK


# -- ``axisbus disable``: stop and disable axes of a running machine ---------------------------------------------------


@click.command("disable")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
@take_option
def disable_command(cell: Path, axes: tuple[str, ...], take: bool) -> int:
    """Stop and disable the axes of CELL, or the named axes, groups or pairs, in the running machine."""
    config = checked(cell)
    names = as_pairs(config, named.chosen(config, axes))
    why, remedy = "happens whenever a machine is closed", f"stop the drives themselves: axisbus stop {cell}"
    with running(cell, "disable", why, remedy, command=True, take=take) as machine:
        chosen = movers(machine, names)
        wait([each.disable() for each in chosen])
        for each in chosen:
            say_state(each)
    return OK
