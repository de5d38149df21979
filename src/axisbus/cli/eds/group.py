"""``axisbus eds``: the workbench for EDS and DCF files."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "check": ("axisbus.cli.eds.check", "Say exactly what is wrong with a file, and where."),
    "fix": ("axisbus.cli.eds.fix", "Mend what can be mended safely; shows a diff, writes only with --write."),
    "list": ("axisbus.cli.eds.list", "List the EDS files that come with axisbus (builtin:NAME)."),
    "show": ("axisbus.cli.eds.show", "Show the dictionary as a tree, or one object."),
    "diff": ("axisbus.cli.eds.diff", "Compare two files by what they mean."),
    "doc": ("axisbus.cli.eds.doc", "Write a complete reference of the drive as HTML or Markdown."),
    "dcf": ("axisbus.cli.eds.dcf", "Make a DCF from an EDS and values, or a concise DCF, and back."),
    "export": ("axisbus.cli.eds.export", "Write the dictionary as CSV or JSON, or the PDOs as DBC."),
    "code": ("axisbus.cli.eds.code", "Write a Python module of the objects, or a C header with the PDOs."),
    "verify": ("axisbus.cli.eds.verify", "Hold a file against the live drive; reads only."),
    "from-device": ("axisbus.cli.eds.from_device", "Take an EDS from the drive, or a skeleton by asking it."),
}


@click.group(cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """Check, mend, show, compare and document EDS and DCF files.

    Exit codes: 0 all well, 1 something was found wrong, 2 wrong use, 3 the bus or a drive failed.
    """
