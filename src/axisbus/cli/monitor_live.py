"""``axisbus monitor`` on a terminal: one table that stays where it is, with what happens told above it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from axisbus.cli.shared.terminal import STYLES

_COLUMNS = ("axis", "state", "position", "velocity", "power", "mode", "bits")
_NUMBERS = frozenset({"position", "velocity"})

Row = Mapping[str, str]
Look = Callable[[], tuple[Sequence[Row], Sequence[str]]]


def show(look: Look, wait: Callable[[], None], count: int | None) -> None:
    """Draw what ``look`` returns (the axes' rows, and the news), ``count`` times (None: until Ctrl-C); ``wait`` between."""
    console = Console(highlight=False, markup=False, emoji=False)
    looks = 0
    with Live(console=console, auto_refresh=False, vertical_overflow="visible") as live:
        while True:
            rows, news = look()
            for line in news:
                live.console.print(Text(line, style=STYLES["warning"]), soft_wrap=True)
            live.update(_table(rows), refresh=True)
            looks += 1
            if count is not None and looks >= count:
                return
            wait()


def _table(rows: Iterable[Row]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in _COLUMNS:
        table.add_column(column, justify="right" if column in _NUMBERS else "left", no_wrap=column != "bits")
    for row in rows:
        table.add_row(*(Text(row[column]) for column in _COLUMNS), style="red" if row["error"] else None)
    return table
