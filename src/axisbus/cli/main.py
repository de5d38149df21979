"""The ``axisbus`` command: its subcommands by name, each loaded only when it is asked for."""

from __future__ import annotations

import importlib
import sys

import click

from axisbus import __version__

# name -> (module, one line for --help); the order is that of a commissioning.
COMMANDS = {
    "demo": ("axisbus.cli.demo", "Run the main job on the simulated cell and draw it."),
    "check": ("axisbus.cli.check", "Find everything wrong with a cell file before the first frame."),
    "scan": ("axisbus.cli.scan", "Show who is on a bus and what they are."),
    "boot": ("axisbus.cli.boot", "Bring the nodes of a cell up and report each; energises nothing."),
    "monitor": ("axisbus.cli.monitor", "Show states, positions and faults of a cell's axes."),
    "home": ("axisbus.cli.home", "Enable axes and home them."),
    "move": ("axisbus.cli.move", "Enable axes and move them to positions."),
    "stop": ("axisbus.cli.stop", "Stop a cell's drives, also beside a running master."),
    "reset": ("axisbus.cli.reset", "Reset faults; enables nothing."),
}


class LazyGroup(click.Group):
    """A group that imports a subcommand's module only when that subcommand runs: ``--help`` stays quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002  # click's shape
        """Return the names in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import and return one subcommand."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(COMMANDS[cmd_name][0]).command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """List the subcommands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="axisbus")
def cli() -> None:
    """A CANopen CiA 402 master: servo drives on a CAN bus as named axes.

    Not a safety function: an emergency stop and safe torque off belong in hardware.

    Exit codes: 0 all well, 1 something was found wrong, 2 wrong use, 3 the bus or a drive failed.
    """


def main() -> None:
    """Run the command line and exit."""
    from axisbus.cli.common import run

    sys.exit(run(cli))
