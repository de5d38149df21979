"""The commands that show an EDS: ``axisbus eds list``, ``show``, ``diff``, ``doc`` and ``export``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click

from axisbus import eds as eds_files
from axisbus.cli.eds.files import (
    can_print,
    file_argument,
    hint,
    node_of,
    node_option,
    open_eds,
    print_plain,
    say_lines,
    say_text,
    terminal_width,
)
from axisbus.cli.shared.common import MISUSE, OK, WRONG, say_error, say_json, say_next, say_table
from axisbus.cli.shared.output import force_option, output_option, require_free, write_and_say
from axisbus.eds import builtin, layout
from axisbus.eds.checking import check
from axisbus.eds.device_doc import html, markdown, reference
from axisbus.eds.model import Eds
from axisbus.eds.report import compare, export_values, overview, show
from axisbus.eds.report.consequences import EdsDifference
from axisbus.eds.report.pdo_text import ASCII, BOXES
from axisbus.eds.report.show import Screen, SearchResult
from axisbus.errors import ArgumentError, EdsError
from axisbus.wording import counted

# -- ``axisbus eds list``: the EDS files that come with axisbus --------------------------------------------------------


@click.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print the list as JSON.")
def list_command(as_json: bool) -> int:
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
    info = eds_files.load(spec).info.get("deviceinfo", {})
    return {"name": spec, "device": info.get("productname", ""), "vendor": info.get("vendorname", "")}


# -- ``axisbus eds show``: show the dictionary as a tree, or one object ------------------------------------------------


@click.command("show")
@file_argument
@click.argument("wanted", metavar="[OBJECT]", required=False)
@node_option
@click.option("--expand", is_flag=True, help="Show every sub-index, even if many are alike.")
@click.option("--json", "as_json", is_flag=True, help="Print entries and PDOs as JSON.")
def show_command(file: str, wanted: str | None, node: int | None, expand: bool, as_json: bool) -> int:
    """Show the dictionary of FILE (an EDS, a DCF or builtin:NAME) as a tree: types, access, defaults, limits, PDO layouts.

    OBJECT shows one object in full: 6041, 1018:1, TPDO1, or a part of a name; if several objects match, they are listed.
    """
    eds = open_eds(file)
    node_id = node_of(eds, node)
    found = show.find(eds, wanted) if wanted is not None else None
    if as_json:
        say_json(export_values.all_values(eds, node_id) if found is None else _json(eds, found, node_id))
        return OK
    style = (
        BOXES if can_print("".join((BOXES.line, BOXES.wall, BOXES.top, BOXES.bottom, BOXES.dots))) else ASCII
    )
    screen = Screen(terminal_width(), style, fold=not expand)
    say_lines(show.tree(eds, node_id, screen) if found is None else _found(eds, found, node_id, screen))
    hint(f"axisbus eds show {file} 6041" if found is None else f"axisbus eds doc {file} -o reference.html")
    return OK


def _found(eds: Eds, found: SearchResult, node_id: int | None, screen: Screen) -> Iterator[str]:
    if found.pdo is not None:
        return show.pdo_lines(_layout(eds, found.pdo, node_id), screen)
    if found.one is not None:
        return show.object_lines(eds, found.matches[0], node_id, screen)
    return show.matches(eds, found.matches, node_id, screen)


def _json(eds: Eds, found: SearchResult, node_id: int | None) -> dict[str, object]:
    pdos = [] if found.pdo is None else [export_values.pdo(_layout(eds, found.pdo, node_id))]
    entries = [
        export_values.entry(match.entry, sub, node_id)
        for match in found.matches
        for sub in match.entry.subs.values()
        if match.subs is None or sub.subindex in match.subs
    ]
    return {"file": eds.source, "node_id": node_id, "pdos": pdos, "entries": entries}


def _layout(eds: Eds, wanted: tuple[bool, int], node_id: int | None) -> layout.PdoLayout:
    """Return a PDO by direction and number.

    Raises:
        EdsError: the file has none.
    """
    pdos = layout.layouts(eds, node_id)
    for each in pdos:
        if (each.receive, each.number) == wanted:
            return each
    name = f"{'RPDO' if wanted[0] else 'TPDO'}{wanted[1]}"
    present = ", ".join(each.name for each in pdos) or "no PDO"
    raise EdsError(f"there is no {name}", file=eds.source, remedy=f"there is: {present}")


# -- ``axisbus eds diff``: compare the meaning of two files ------------------------------------------------------------


@click.command("diff")
@click.argument("a")
@click.argument("b")
@node_option
@click.option("--json", "as_json", is_flag=True, help="Print the differences as JSON.")
def diff_command(a: str, b: str, node: int | None, as_json: bool) -> int:
    """Compare the meaning of two EDS or DCF files: 0x0A equals 10, the order and the spelling of $NODEID+x do not matter.

    It is made for comparing two firmware versions of one drive: the differences that matter for a master come first. With
    --node (or when one file is a DCF), values are compared as they are for that node. [FileInfo] is not compared.

    Exit codes: 0 the same, 1 different, 2 a file cannot be read.
    """
    try:
        first, second = open_eds(a), open_eds(b)
    except EdsError as error:
        say_error(str(error))
        return MISUSE  # 1 means that they differ
    node_id = _common_node(first, second, node)
    differences = compare.diff(first, second, node_id)
    if as_json:
        say_json(compare.plain(first, second, differences, node_id))
    else:
        say_lines(compare.lines(first, second, differences, node_id))
        if differences:
            hint(f"axisbus eds show {b} {_example(differences)}".rstrip())
    return WRONG if differences else OK


def _example(differences: tuple[EdsDifference, ...]) -> str:
    """Return the index of an object that differs and exists in B; empty if there is none."""
    return next((f"{each.index:04X}" for each in differences if each.index is not None and each.b), "")


def _common_node(a: Eds, b: Eds, node: int | None) -> int | None:
    """Return the node ID for the comparison: the requested one, or the only one that the files are made for."""
    node_ids = {eds.node_id for eds in (a, b) if eds.node_id is not None}
    if node is not None or len(node_ids) != 1:
        return node
    return node_ids.pop()


# -- ``axisbus eds doc``: write a complete reference of the device -----------------------------------------------------


_WRITERS = {".html": html, ".htm": html, ".md": markdown, ".markdown": markdown}


@click.command("doc")
@file_argument
@output_option("Where to write [default: the name of FILE with .html].")
@force_option
@node_option
def doc_command(file: str, output: Path | None, force: bool, node: int | None) -> int:
    """Write a complete reference of the device of FILE (an EDS, a DCF or builtin:NAME): every object, and the layouts of the PDOs.

    -o names the file, x.html (one self-contained page, also suited for printing) or x.md; without it, the name of FILE with
    .html in this folder. With --node, values are those for this node ID.
    """
    require_free(output, force=force)
    eds = open_eds(file)
    if output is None:
        output = Path(f"{Path(eds.source).stem}.html")
        require_free(output, force=force)
    writer = _WRITERS.get(output.suffix.lower())
    if writer is None:
        raise ArgumentError(f"{output}: no such format", remedy="give a name that ends in .html or .md")
    page = reference(eds, node_of(eds, node), check(eds))
    next_step = f"open {output} in a browser" if writer is html else f"axisbus eds show {file}"
    what = f"written, {overview.contents(eds)}, {page.verdict}"
    write_and_say(output, writer(page).encode(), what, next_step)
    return OK


# -- ``axisbus eds export``: export the dictionary for other programs --------------------------------------------------


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
def export_command(
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
        print_plain(f"left out: {each}")
    if output is None:
        say_text(text)
        return OK
    next_step = f"axisbus eds doc {file} -o {output.with_suffix('.html')}"
    write_and_say(output, text.encode(), f"written, {counted(len(text.splitlines()), 'line')}", next_step)
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

        dbc = frames.dumps(eds, node_id, switched_off=switched_off, words=words)
        return dbc.text, dbc.left_out
    return (export_values.csv_text if form == "csv" else export_values.json_text)(eds, node_id), ()
