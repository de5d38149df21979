"""Small HTML tables for the display of objects in a notebook: escaped text, without colours, scripts or files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from html import escape

_LEFT = ' style="text-align:left;vertical-align:top"'


def text(value: object) -> str:
    """Return an escaped text with line breaks."""
    return "<br>".join(escape(line) for line in str(value).splitlines())


def table(title: str, rows: Iterable[Sequence[object]], heads: Sequence[str] = (), note: str = "") -> str:
    """Return a table with a title; all plain text. The first cell of each row is its head; ``note`` is below the table."""
    head = f"<thead><tr>{_cells('th', heads)}</tr></thead>" if heads else ""
    body = "".join(f"<tr>{_cells('th', row[:1])}{_cells('td', row[1:])}</tr>" for row in rows)
    beneath = f"<p>{text(note)}</p>" if note else ""
    return f"<div><p><b>{text(title)}</b></p><table>{head}<tbody>{body}</tbody></table>{beneath}</div>"


def guarded(what: str, make: Callable[[], str]) -> str:
    """Return the result of ``make``; if it fails, a line that says so: a display never raises."""
    try:
        return make()
    except Exception as error:  # noqa: BLE001  # whatever it is, a notebook would show its traceback in place of the object
        return f"<p><b>{text(what)}</b>: it cannot be displayed ({text(type(error).__name__)})</p>"


def _cells(tag: str, values: Sequence[object]) -> str:
    return "".join(f"<{tag}{_LEFT}>{text(value)}</{tag}>" for value in values)
