"""``axisbus monitor`` on a terminal: one table that stays where it is, the state of the machine and what happened last below it."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from axisbus.cli.shared.terminal import STYLES
from axisbus.motion.states import MOVING, AxisState

_COLUMNS = ("axis", "state", "position", "velocity", "age", "power", "mode", "bits")
_NUMBERS = frozenset({"position", "velocity", "age"})
_STATE_STYLES = {
    **{state.value: "green" for state in MOVING},
    AxisState.DISABLED.value: "dim",
    AxisState.STOPPING.value: "yellow",
    AxisState.ERRORSTOP.value: "bold red",
}
_BELOW = 8  # lines of what happened last; what is older scrolls away above the table

Row = Mapping[str, str]


class Seen(NamedTuple):
    """One look: the axes' rows, lines about the machine, and what has happened since the last."""

    rows: Sequence[Row]
    machine: Sequence[str]
    news: Sequence[str]


def show(look: Callable[[], Seen], wait: Callable[[], None], count: int | None) -> None:
    """Draw what ``look`` returns, ``count`` times (None: until Ctrl-C); ``wait`` between."""
    console = Console(highlight=False, markup=False, emoji=False)
    looks, last = 0, deque[Text]()
    with Live(console=console, auto_refresh=False, vertical_overflow="visible") as live:
        while True:
            seen = look()
            last.extend(_timed(seen.news))
            while len(last) > _BELOW:
                live.console.print(last.popleft(), soft_wrap=True)
            live.update(Group(*_parts(seen, last)), refresh=True)
            looks += 1
            if count is not None and looks >= count:
                return
            wait()


def _timed(news: Sequence[str]) -> list[Text]:
    now = time.strftime("%H:%M:%S")
    return [Text(f"{now}  {line}", style=STYLES["warning"]) for line in news]


def _parts(seen: Seen, last: Iterable[Text]) -> list[RenderableType]:
    return [_table(seen.rows), *(Text(line, style="dim") for line in seen.machine), *last]


def _table(rows: Iterable[Row]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in _COLUMNS:
        table.add_column(column, justify="right" if column in _NUMBERS else "left", no_wrap=column != "bits")
    for row in rows:
        table.add_row(*(_cell(row, column) for column in _COLUMNS))
    return table


def _cell(row: Row, column: str) -> Text:
    return Text(row[column], style=_STATE_STYLES.get(row["state"], "") if column == "state" else "")
