"""``axisbus monitor`` on a terminal: one table at a fixed position, with the state of the machine and the last events below."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from axisbus.cli.shared.common import STYLES, rounds
from axisbus.motion.states import MOVING, AxisState
from axisbus.wording import printable

_COLUMNS = ("axis", "state", "position", "velocity", "age", "power", "mode", "bits")
_DROPPED_COLUMNS = (
    "bits",
    "age",
    "mode",
    "velocity",
    "power",
)  # left out on a narrow terminal, in this order
_GAP = "  "
_MIN_BITS_WIDTH = 12  # columns; with fewer, the bits are not readable
_MIN_NEWS_LINES = 6  # lines; they have priority over the machine's own lines
_NUMBERS = frozenset({"position", "velocity", "age"})
STATE_STYLES = {
    **{state.value: "green" for state in MOVING},
    AxisState.DISABLED.value: "dim",
    AxisState.STOPPING.value: "yellow",
    AxisState.ERRORSTOP.value: "bold red",
}
_BELOW = 8  # the most of the newest events below the table; older ones scroll away above it

Row = Mapping[str, str]


class MonitorUpdate(NamedTuple):
    """One update: the axes' rows, lines about the machine, and the news since the last one."""

    rows: Sequence[Row]
    machine: Sequence[str]
    news: Sequence[str]


def show(read_update: Callable[[], MonitorUpdate], wait: Callable[[], None], count: int | None) -> None:
    """Draw the result of ``read_update``, ``count`` times (None: until Ctrl-C); ``wait`` in between."""
    console = Console(highlight=False, markup=False, emoji=False)
    last = deque[Text]()
    with Live(console=console, auto_refresh=False, vertical_overflow="crop") as live:
        for _ in rounds(count, wait):
            update = read_update()
            last.extend(_timed(update.news))
            head = _head(update, console.width, console.height - 1)
            for older in _excess(last, console, console.height - 1 - len(head)):
                live.console.print(older, soft_wrap=True)
            live.update(Group(*head, *last), refresh=True)


def _timed(news: Sequence[str]) -> list[Text]:
    now = time.strftime("%H:%M:%S")
    return [Text(printable(f"{now}  {line}"), style=STYLES["warning"]) for line in news]


def _excess(last: deque[Text], console: Console, room: int) -> Iterator[Text]:
    """Remove the oldest from ``last`` until the others fit into ``room`` lines; a single one is cut at its end.

    Each removed one is yielded completely, to be printed above the table, into the scrollback.
    """

    def lines(text: Text) -> int:
        return len(text.wrap(console, console.width))

    while len(last) > _BELOW or (len(last) > 1 and sum(map(lines, last)) > room):
        yield last.popleft()
    if last and lines(last[0]) > room:
        oldest = last.popleft()
        yield oldest
        if room > 0:
            begin = Text("\n").join(oldest.wrap(console, console.width)[:room])
            begin.truncate(max(1, len(begin) - 1))
            last.append(begin.append("\N{HORIZONTAL ELLIPSIS}"))


def _head(update: MonitorUpdate, width: int, room: int) -> list[Text]:
    """Return the table and the lines about the machine, each cut to the width, and at most ``room`` of them."""
    lines = _table(update.rows, width)
    if len(lines) > room:
        hidden = len(lines) - max(1, room - 1)
        lines = [
            *lines[: max(1, room - 1)],
            Text(f"{hidden} more: increase the height of the window", style="dim"),
        ]
    machine_lines = [Text(printable(line), style="dim") for line in update.machine]
    lines += machine_lines[: max(0, room - len(lines) - _MIN_NEWS_LINES)]
    for line in lines:
        line.truncate(width, overflow="ellipsis")
    return lines


def _table(rows: Sequence[Row], width: int) -> list[Text]:
    """Return a line of headings and one for each axis; columns in ``_DROPPED_COLUMNS`` are omitted in this order to fit."""
    widths = {column: max(map(len, (column, *(row[column] for row in rows)))) for column in _COLUMNS}
    for column in _DROPPED_COLUMNS:
        excess = sum(widths.values()) + len(_GAP) * (len(widths) - 1) - width
        if excess <= 0:
            break
        if column == "bits" and widths[column] - excess >= _MIN_BITS_WIDTH:
            widths[column] -= excess
        else:
            del widths[column]
    head = Text(_GAP.join(_fitted(column, column, size) for column, size in widths.items()), style="bold")
    return [head, *(_line(row, widths) for row in rows)]


def _line(row: Row, widths: Mapping[str, int]) -> Text:
    gap = Text(_GAP)
    return gap.join(
        Text(
            _fitted(row[column], column, size),
            style=STATE_STYLES.get(row["state"], "") if column == "state" else "",
        )
        for column, size in widths.items()
    )


def _fitted(text: str, column: str, size: int) -> str:
    text = printable(text)
    if len(text) > size:
        return text[: size - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return text.rjust(size) if column in _NUMBERS else text.ljust(size)
