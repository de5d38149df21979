"""``axisbus eds list``: the EDS files that come with axisbus."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus import eds as eds_files
from axisbus.cli.shared.common import OK, say_json, say_next
from axisbus.cli.shared.terminal import say_table
from axisbus.eds import builtin


@click.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print the list as JSON.")
def command(as_json: bool) -> int:
    """List the EDS files that come with axisbus: the names for eds = "builtin:NAME" in a cell file and for axisbus eds."""
    rows = [_row(name) for name in builtin.names()]
    if as_json:
        say_json({"files": rows})
    else:
        say_table(("name", "device", "vendor"), [tuple(row.values()) for row in rows])
        say_next(
            f"axisbus eds show {rows[0]['name']}"
            if rows
            else "axisbus eds from-device reads one from a drive"
        )
    return OK


def _row(name: str) -> dict[str, str]:
    spec = f"{builtin.PREFIX}{name}"
    info = eds_files.load(builtin.resolve(spec, Path())).info.get("deviceinfo", {})
    return {"name": spec, "device": info.get("productname", ""), "vendor": info.get("vendorname", "")}
