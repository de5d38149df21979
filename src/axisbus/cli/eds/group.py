"""``axisbus eds``: the workbench for EDS and DCF files."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "check": ("axisbus.cli.eds.check", "Show all errors of a file, with their locations."),
    "fix": (
        "axisbus.cli.eds.fix",
        "Fix the errors that can be fixed safely; shows a diff, writes only with --write.",
    ),
    "list": (
        "axisbus.cli.eds.reports:list_command",
        "List the EDS files that come with axisbus (builtin:NAME).",
    ),
    "show": ("axisbus.cli.eds.reports:show_command", "Show the dictionary as a tree, or one object."),
    "diff": ("axisbus.cli.eds.reports:diff_command", "Compare the meaning of two files."),
    "doc": (
        "axisbus.cli.eds.reports:doc_command",
        "Write a complete reference of the drive as HTML or Markdown.",
    ),
    "dcf": ("axisbus.cli.eds.dcf", "Make a DCF from an EDS and values, or a concise DCF, and back."),
    "export": (
        "axisbus.cli.eds.reports:export_command",
        "Write the dictionary as CSV or JSON, or the PDOs as DBC.",
    ),
    "code": ("axisbus.cli.eds.code", "Write a Python module of the objects, or a C header with the PDOs."),
    "verify": (
        "axisbus.cli.eds.device:verify_command",
        "Compare a file with the connected drive; reads only.",
    ),
    "from-device": (
        "axisbus.cli.eds.device:from_device_command",
        "Read the EDS from the drive, or make a skeleton of it.",
    ),
}


@click.group(cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """Check, fix, show, compare and document EDS and DCF files.

    Exit codes: 0 all well, 1 something was found wrong, 2 wrong use, 3 the bus or a drive failed.
    """
