"""``axisbus record faults``: list the recordings of a cell's last faults."""

from __future__ import annotations

import textwrap
from pathlib import Path

import click

from axisbus.cell import reader
from axisbus.cli.shared.common import OK, say, say_next
from axisbus.cli.shared.options import PATH
from axisbus.core.process.launch import path_of
from axisbus.core.process.persistence.journal import faults_of
from axisbus.errors import UserError
from axisbus.record.load import load
from axisbus.record.recording_data import Recorded

_TOLD = ("emcy", "nmt", "command")  # the most informative sort first


_WIDTH = 140


@click.command("faults")
@click.argument("cell", type=PATH)
def faults_command(cell: Path) -> int:
    """List the stored faults of CELL, the oldest first: the newest 20, each with 1.5 s before and 1 s after it.

    The core stores them automatically if it runs in its own process; axisbus plot draws one.
    """
    found = faults_of(path_of(reader.load(cell)))
    for path in found:
        say(f"{path}\n    {_line(path)}")
    if not found:
        say(f"no fault of {cell} has been stored")
        return OK
    say_next(f"axisbus plot {found[-1]} -o fault.png")
    return OK


def _line(path: Path) -> str:
    try:
        return _what(load(path))
    except UserError as error:
        return error.message


def _what(recorded: Recorded) -> str:
    faulty = [name for name, track in recorded.tracks.items() if "ErrorStop" in track.columns["state"]]
    words = [
        f"{event.where}: {event.text}"
        for sort in _TOLD
        for event in recorded.events
        if event.sort == sort and (sort != "command" or event.text.startswith("ended"))
    ]
    text = f"{', '.join(faulty)} in ErrorStop; {words[0] if words else 'without an emergency message'}"
    return textwrap.shorten(text, _WIDTH, placeholder=" …")
