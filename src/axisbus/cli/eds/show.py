"""``axisbus eds show``: show the dictionary as a tree, or one object."""

from __future__ import annotations

from collections.abc import Iterator

import click

from axisbus.cli.eds.files import (
    can_print,
    file_argument,
    hint,
    node_of,
    node_option,
    open_eds,
    say_lines,
    terminal_width,
)
from axisbus.cli.shared.common import OK, say_json
from axisbus.eds import layout
from axisbus.eds.model import Eds
from axisbus.eds.report import export_values, search, show
from axisbus.eds.report.pdo_text import ASCII, BOXES
from axisbus.eds.report.search import SearchResult
from axisbus.eds.report.show import Screen
from axisbus.errors import EdsError


@click.command("show")
@file_argument
@click.argument("wanted", metavar="[OBJECT]", required=False)
@node_option
@click.option("--expand", is_flag=True, help="Show every sub-index, even if many are alike.")
@click.option("--json", "as_json", is_flag=True, help="Print entries and PDOs as JSON.")
def command(file: str, wanted: str | None, node: int | None, expand: bool, as_json: bool) -> int:
    """Show the dictionary of FILE (an EDS, a DCF or builtin:NAME) as a tree: types, access, defaults, limits, PDOs drawn.

    OBJECT shows one object in full: 6041, 1018:1, TPDO1, or a part of a name; if several objects match, they are listed.
    """
    eds = open_eds(file)
    node_id = node_of(eds, node)
    found = search.find(eds, wanted) if wanted is not None else None
    if as_json:
        say_json(export_values.whole(eds, node_id) if found is None else _json(eds, found, node_id))
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
        _layout(eds, found.pdo)
        return show.pdo_lines(eds, *found.pdo, node_id, screen)
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


def _layout(eds: Eds, wanted: tuple[bool, int], node_id: int | None = None) -> layout.PdoLayout:
    """Return a PDO by direction and number.

    Raises:
        EdsError: the file has none.
    """
    pdos = layout.layouts(eds, node_id)
    for each in pdos:
        if (each.receive, each.number) == wanted:
            return each
    name = f"{'RPDO' if wanted[0] else 'TPDO'}{wanted[1]}"
    there = ", ".join(each.name for each in pdos) or "no PDO"
    raise EdsError(f"there is no {name}", file=eds.source, remedy=f"there is: {there}")
