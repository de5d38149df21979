"""``axisbus fleet watch`` on a terminal: one table at a fixed position; unknown values are grey."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from axisbus.cli.fleet.cell_rows import (
    UNKNOWN,
    Recordings,
    axis_rows,
    heading,
    incident_lines,
    recordings_line,
)
from axisbus.cli.monitor.live import STATE_STYLES
from axisbus.cli.shared.common import STYLES, rounds
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.fleet.cell import FleetCell

Found = Sequence[tuple["FleetCell", Recordings]]
ReadCells = Callable[[], Found]
_COLUMNS = ("cell", "axis", "state", "position", "velocity", "age", "")
_NUMBERS = frozenset({"position", "velocity", "age"})
_STATE_STYLES = {**STATE_STYLES, UNKNOWN: "dim"}
_STATE = 1  # column index
_MAX_INCIDENT_LINES = 12  # the most lines of incidents


def show(
    read_cells: ReadCells, extra_lines: Callable[[], Sequence[str]], every: float, count: int | None
) -> None:
    """Draw the cells ``count`` times (None: until Ctrl-C); ``extra_lines`` returns the plant's name and its problems."""
    console = Console(highlight=False, markup=False, emoji=False)
    with Live(console=console, auto_refresh=False, vertical_overflow="ellipsis") as live:
        for _ in rounds(count, lambda: time.sleep(every)):
            live.update(Group(*_parts(read_cells(), *extra_lines())), refresh=True)


def _parts(found: Found, plant: str, *wrong: str) -> list[RenderableType]:
    """Return the parts to draw: problems come first, because the end may be cut off at the bottom of the screen."""
    alive_count = sum(cell.alive for cell, _ in found)
    head = f"{plant}: {alive_count} of {counted(len(found), 'cell')} alive, {time.strftime('%H:%M:%S')}"
    incidents = [(cell, line) for cell, _ in found for line in incident_lines(cell)]
    failed, healthy = (
        [each for each in found if bool(_style(each[0])) is is_failed] for is_failed in (True, False)
    )
    return [
        Text(head, style="bold"),
        *(Text(line, style=STYLES["error"]) for line in wrong),
        _cells(failed),
        *(
            Text(f"{cell.name}  {line}", style=STYLES["warning"])
            for cell, line in incidents[-_MAX_INCIDENT_LINES:]
        ),
        _cells(healthy),
        _axes([cell for cell, _ in found]),
    ]


def _cells(found: Found) -> Table:
    table = Table(box=None, pad_edge=False, show_header=False)
    for cell, recordings in found:
        table.add_row(
            Text(cell.name, style="bold"),
            Text(
                ", ".join([*heading(cell), *([recordings_line(recordings)] if cell.alive else [])]),
                style=_style(cell),
            ),
        )
    return table


def _style(cell: FleetCell) -> str:
    """Return the style of a cell that is gone or irregular; empty for a normal cell."""
    if not cell.alive:
        return STYLES["error"]
    return STYLES["warning"] if cell.version_mismatch or cell.duplicate_bridge else ""


def _axes(cells: Sequence[FleetCell]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in _COLUMNS:
        table.add_column(column, justify="right" if column in _NUMBERS else "left", no_wrap=column != "")
    for cell in cells:
        for row in axis_rows(cell):
            table.add_row(cell.name, *(_cell(row, number, text) for number, text in enumerate(row)))
    return table


def _cell(row: Sequence[str], number: int, text: str) -> Text:
    if row[_STATE] == UNKNOWN:
        return Text(text, style="dim")
    return Text(text, style=_STATE_STYLES.get(text, "") if number == _STATE else "")
