"""``axisbus record``: recordings of a cell; without a subcommand a recording is made."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

_START = "start"
COMMANDS = {
    _START: ("axisbus.cli.record.start", "Record the machine of a cell; the word start may be left out."),
    "faults": ("axisbus.cli.record.faults:faults_command", "List the stored faults of a cell."),
    "export": ("axisbus.cli.record.files:export_command", "Write a recording as CSV or Parquet."),
    "diff": ("axisbus.cli.record.files:diff_command", "Compare two recordings of the same job."),
}
_HELP = ("-h", "--help")


class _Group(LazyGroup):
    """A group whose default subcommand makes a recording."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Insert the omitted subcommand."""
        if args and args[0] not in COMMANDS and args[0] not in _HELP:
            args = [_START, *args]
        return super().parse_args(ctx, args)


@click.group(cls=_Group, table=COMMANDS, context_settings={"help_option_names": list(_HELP)})
def command() -> None:
    """Record each cycle of a cell's axes into an MCAP file: axisbus record cell.toml -o run.mcap

    Joins the machine of the cell if it is already running. See axisbus record start -h.
    """
