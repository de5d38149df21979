"""The ``axisbus`` command: its subcommands by name, each imported only when requested."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import click

from axisbus.cli.shared.lazy import LazyGroup, Table
from axisbus.version import __version__

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

_GROUP = "axisbus_commands"  # entry points of other packages, each a command of click
# In the order of commissioning.
_BUILT_IN: Table = {
    "demo": ("axisbus.cli.demo", "Demonstrate axisbus on the simulated cell, and draw the motion."),
    "examples": (
        "axisbus.cli.examples",
        "List the example programs and cell files, or copy them into a folder.",
    ),
    "eds": ("axisbus.cli.groups:eds", "Check, fix, show, compare and document EDS and DCF files."),
    "drives": ("axisbus.cli.drives", "List the drive plug-ins, show one, and check a drive file."),
    "check": ("axisbus.cli.check", "Find the errors and dangers in a cell file before the first frame."),
    "report": ("axisbus.cli.report", "Collect in one archive what a report of a fault needs."),
    "explain": ("axisbus.cli.explain", "Print the meaning of a symptom, and what to check."),
    "plan": ("axisbus.cli.plan", "Show the timetable of a cell's cycle, and how short it can be."),
    "scan": ("axisbus.cli.scan", "Show the nodes on a bus and their identities."),
    "init": ("axisbus.cli.init", "Write a first cell file from a scan of the bus; reads only."),
    "lss": (
        "axisbus.cli.groups:lss",
        "Find nodes without a node-ID; set node-IDs and bit rates over the bus.",
    ),
    "nmt": ("axisbus.cli.nmt", "Start, stop or reset nodes (NMT), and show their reactions."),
    "od": ("axisbus.cli.groups:od", "Read, write, list and watch the objects of a node."),
    "config": (
        "axisbus.cli.groups:config",
        "Back up, compare and restore the configuration of a node as a DCF.",
    ),
    "save": ("axisbus.cli.save", "Make a node store its parameters (1010h)."),
    "program": ("axisbus.cli.groups:program", "Show, write and verify the program (firmware) of a node."),
    "nameplate": ("axisbus.cli.nameplate", "Show, save and compare what identifies the nodes of a cell."),
    "boot": ("axisbus.cli.boot", "Boot the nodes of a cell, and report on each; energises nothing."),
    "replace": (
        "axisbus.cli.replace",
        "Make a new drive the drive of a node: node-ID, stored configuration, boot-up.",
    ),
    "sim": ("axisbus.cli.sim", "Simulate the drives of a cell, for other terminals and programs."),
    "run": ("axisbus.cli.run", "Keep a cell's machine running, for other terminals and programs to join."),
    "monitor": ("axisbus.cli.monitor.axes", "Show states, positions and faults of a cell's axes."),
    "web": ("axisbus.cli.web", "Serve a page in the browser: see a cell's axes, and command them."),
    "bridge": (
        "axisbus.cli.groups:bridge",
        "Connect a cell's machine to Zenoh, OPC UA or Prometheus.",
    ),
    "fleet": ("axisbus.cli.groups:fleet", "See and stop the cells of a plant over its Zenoh network."),
    "record": (
        "axisbus.cli.groups:record",
        "Record the axes of a cell; compare and export recordings.",
    ),
    "plot": ("axisbus.cli.record.files:plot_command", "Draw a recording."),
    "trace": ("axisbus.cli.trace", "Show the frames of a bus or a recording, decoded."),
    "load": ("axisbus.cli.load", "Show the load of a bus, planned and measured."),
    "jitter": ("axisbus.cli.jitter", "Measure the jitter of a cell's cycle."),
    "enable": ("axisbus.cli.enabling:enable_command", "Enable axes of a running machine."),
    "home": ("axisbus.cli.enabling:home_command", "Enable axes and home them."),
    "move": ("axisbus.cli.move", "Enable axes and move them to positions."),
    "velocity": (
        "axisbus.cli.continuous_motion:velocity_command",
        "Enable axes and move them at velocities.",
    ),
    "torque": ("axisbus.cli.continuous_motion:torque_command", "Enable axes and apply torques."),
    "jog": ("axisbus.cli.jog", "Move an axis by the arrow keys, while a key is held."),
    "probe": ("axisbus.cli.probe", "Show the position of an axis at each edge of its touch probe."),
    "halt": (
        "axisbus.cli.stopping:halt_command",
        "Halt axes of a running machine, whichever program has control.",
    ),
    "disable": ("axisbus.cli.enabling:disable_command", "Stop and disable axes of a running machine."),
    "stop": ("axisbus.cli.stopping:stop_command", "Stop a cell's drives, even if another master is running."),
    "reset": ("axisbus.cli.enabling:reset_command", "Reset faults; enables nothing."),
}
_BEFORE = "lss"  # the command that those of the drive plug-ins precede


class _Commands(Mapping[str, tuple[str, str]]):
    """The table of all commands; other packages are asked only for a name that is no command of axisbus itself."""

    def __getitem__(self, name: str) -> tuple[str, str]:
        built_in = _of_axisbus(name)
        return _of_plugins()[name] if built_in is None else built_in

    def __iter__(self) -> Iterator[str]:
        for name in _BUILT_IN:
            if name == _BEFORE:
                yield from _of_plugins()
            yield name

    def __len__(self) -> int:
        return sum(1 for _ in self)


def _of_plugins() -> Table:
    others = {
        name: (entry.value, f"A command of {_package(entry)}.") for name, entry in _of_packages().items()
    }
    return {**others, **_of_built_in_plugins()}


def _of_axisbus(name: str) -> tuple[str, str] | None:
    """Return the row of a command of axisbus itself, without asking other packages."""
    return _BUILT_IN[name] if name in _BUILT_IN else _of_built_in_plugins().get(name)


def _of_built_in_plugins() -> Table:
    from axisbus.drives.descriptions import descriptions

    return {name: command for each in descriptions() for name, command in each.commands.items()}


def _of_packages() -> dict[str, EntryPoint]:
    """Return the commands of other packages by name; those of axisbus precede one with the same name."""
    from importlib.metadata import entry_points

    found = sorted(entry_points(group=_GROUP), key=lambda entry: entry.name)
    return {entry.name: entry for entry in found if _of_axisbus(entry.name) is None}


def _package(entry: EntryPoint) -> str:
    return "a package" if entry.dist is None else f"the package {entry.dist.name} {entry.dist.version}"


COMMANDS = _Commands()


class _AllCommands(LazyGroup):
    """The group of all commands; a command of another package that cannot be loaded becomes one that reports the error."""

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one subcommand."""
        other = None if _of_axisbus(cmd_name) else _of_packages().get(cmd_name)
        try:
            found = super().get_command(ctx, cmd_name)
        except Exception as error:
            if other is None:
                raise
            return _unusable(other, f"{type(error).__name__}: {error}")
        if other is not None and not isinstance(found, click.Command):
            return _unusable(other, f"{other.value} is not a command of click")
        return found


def _unusable(entry: EntryPoint, why: str) -> click.Command:
    """Return a command that takes any arguments, and raises the error of loading the command of a package."""
    from axisbus.errors import UserError

    def fail() -> None:
        package = _package(entry)
        raise UserError(
            f"the command {entry.name} of {package} cannot be loaded",
            observed=why,
            remedy=f"update or uninstall {package}",
        )

    pass_through: dict[str, Any] = {"ignore_unknown_options": True, "allow_extra_args": True}
    return click.Command(entry.name, callback=fail, context_settings=pass_through, add_help_option=False)


@click.group(cls=_AllCommands, table=COMMANDS)
@click.version_option(__version__, prog_name="axisbus")
def cli() -> None:
    """A CANopen CiA 402 master: servo drives on a CAN bus as named axes.

    Not a safety function: an emergency stop and safe torque off belong in hardware.

    Exit codes: 0 all well, 1 something was found wrong, 2 wrong use, 3 the bus or a drive failed.
    """


def main() -> None:
    """Run the command line and exit."""
    from axisbus.cli.shared.common import FAILURE, run

    code = run(cli)
    try:
        sys.stdout.flush()
    except OSError:  # a pipe that is no longer read: Python would report it again at its end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = code or FAILURE
    sys.exit(code)
