"""Coloured output on a terminal, plain output everywhere else; NO_COLOR disables colours (no-color.org)."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

import click

from axisbus.wording import printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

STYLES = {"error": "bold red", "warning": "yellow", "note": "cyan"}


def coloured() -> bool:
    """Whether standard output is a terminal with colours, and the user has not disabled them."""
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return False
    return sys.stdout.isatty()


def say_styled(text: str, word: str, style: str) -> None:
    """Print ``text``; on a terminal the first ``word`` of it is in ``style`` (rich's)."""
    if not coloured():
        click.echo(printable(text))
        return
    from rich.text import Text

    text = printable(text)
    styled = Text(text)
    begin = text.find(word)
    if begin >= 0:
        styled.stylize(style, begin, begin + len(word))
    _console().print(styled, soft_wrap=True)


def say_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table, at most as wide as its terminal."""
    from rich.table import Table

    table = Table(*headings, box=None, pad_edge=False, header_style="bold")
    for row in rows:
        table.add_row(*map(printable, row))
    _console().print(table)


def _console() -> Any:
    from rich.console import Console

    return Console(highlight=False, markup=False, emoji=False)
