"""``axisbus eds export``: export the dictionary for other programs."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.eds.files import file_argument, node_of, node_option, open_eds, say_text, tell
from axisbus.cli.shared.common import OK, say, say_next
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError
from axisbus.wording import counted

_FORMATS = ("csv", "json", "dbc")


@click.command("export")
@file_argument
@click.option("--csv", "form", flag_value="csv", help="One row per entry.")
@click.option("--json", "form", flag_value="json", help="Device, PDOs and entries.")
@click.option(
    "--dbc", "form", flag_value="dbc", help="The frames of the node; needs --node and axisbus[dbc]."
)
@click.option("--switched-off", is_flag=True, help="In a DBC, also the PDOs that are disabled.")
@click.option("--words", is_flag=True, help="In a DBC, a statusword as one signal, not one per bit.")
@output_option("Where to write [default: standard output].")
@force_option
@node_option
def command(
    file: str,
    form: str | None,
    switched_off: bool,
    words: bool,
    output: Path | None,
    force: bool,
    node: int | None,
) -> int:
    """Write the dictionary of FILE (an EDS, a DCF or builtin:NAME) as CSV or JSON, or its PDOs as DBC.

    Writes to standard output, or with -o to a file, whose ending (.csv, .json, .dbc) may name the format. With --node, values
    that depend on the node ID are those for it; a DBC needs it.
    """
    chosen = _chosen(form, output)
    if chosen != "dbc" and (switched_off or words):
        raise ArgumentError(
            f"--switched-off and --words have no effect on {chosen.upper()}", remedy="leave them out"
        )
    require_free(output, force=force)
    eds = open_eds(file)
    text, left_out = _text(eds, chosen, node_of(eds, node), switched_off, words)
    for each in left_out:
        tell(f"left out: {each}")
    if output is None:
        say_text(text)
        return OK
    write_whole(output, text.encode())
    say(f"{output}: written, {counted(len(text.splitlines()), 'line')}")
    say_next(f"axisbus eds doc {file} -o {output.with_suffix('.html')}")
    return OK


def _chosen(form: str | None, output: Path | None) -> str:
    ending = output.suffix.lower().lstrip(".") if output is not None else ""
    chosen = form or (ending if ending in _FORMATS else "")
    if not chosen:
        raise ArgumentError(
            "no format is given", remedy="give --csv, --json or --dbc, or -o with such an ending"
        )
    return chosen


def _text(
    eds: Eds, form: str, node_id: int | None, switched_off: bool, words: bool
) -> tuple[str, tuple[str, ...]]:
    if form == "dbc":
        from axisbus.eds.report import frames

        made = frames.dumps(eds, node_id, switched_off=switched_off, words=words)
        return made.text, made.left_out
    from axisbus.eds.report import export_values

    return (export_values.csv_text if form == "csv" else export_values.json_text)(eds, node_id), ()
