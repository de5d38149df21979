"""Common parts of the subcommands for EDS files: reading FILE, the node ID, the screen."""

from __future__ import annotations

import glob
import os
import shutil
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import click

from axisbus.cli.shared.common import echo, say_next
from axisbus.eds import Eds, load
from axisbus.errors import EdsError
from axisbus.wording import counted, printable

MAX_ENTRIES = 100_000  # ten times the number of the largest known file; listing a million takes minutes


file_argument = click.argument("file")


node_option = click.option(
    "--node", type=click.IntRange(1, 127), help="Node ID for values with $NODEID [default: that of a DCF]."
)


def expanded(files: Iterable[str]) -> Iterator[str]:
    """Yield each file once, with patterns (if the shell left them) replaced by the matching files."""
    done_files = set()
    for given in files:
        pattern = glob.has_magic(given) and not Path(given).exists()
        for file in (sorted(glob.glob(given, recursive=True)) or [given]) if pattern else [given]:
            if file not in done_files:
                done_files.add(file)
                yield file


def open_eds(file: str) -> Eds:
    """Read FILE: a path, or ``builtin:NAME``.

    Raises:
        EdsError: the file cannot be read, is not an EDS, or has more entries than a report can list.
    """
    eds = load(file)
    count = sum(len(entry.subs) for entry in eds)
    if count > MAX_ENTRIES:
        raise EdsError(
            "the file describes more entries than any device has",
            file=file,
            observed=f"{counted(count, 'entry', 'entries')}, {MAX_ENTRIES} at most can be listed",
            remedy=f"look at CompactSubObj in it: axisbus eds check {file}",
        )
    return eds


def node_of(eds: Eds, node: int | None) -> int | None:
    """Return the requested node ID, else that of a DCF."""
    return eds.node_id if node is None else node


def terminal_width() -> int | None:
    """Return the columns of the terminal or of ``COLUMNS``; None for a pipe, which takes lines of any length."""
    if sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdigit():
        return max(40, shutil.get_terminal_size().columns)
    return None


def can_print(text: str) -> bool:
    """Whether standard output can encode these characters."""
    try:
        text.encode(sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def say_lines(lines: Iterable[str], *, styled: bool = False) -> None:
    """Print all lines at once; characters that standard output cannot encode become question marks.

    ``styled``: the lines have control sequences of the terminal, and the caller has made foreign names printable.
    """
    text = "\n".join(lines)
    if not can_print(text):
        encoding = sys.stdout.encoding or "ascii"
        text = text.encode(encoding, errors="replace").decode(encoding)
    click.echo(text if styled else printable(text))


def hint(text: str) -> None:
    """Print the next command to type, on a terminal only, so that a report in a pipe has nothing else."""
    if sys.stdout.isatty():
        say_next(text)


def say_text(text: str) -> None:
    """Print a whole file to standard output as UTF-8, whatever the encoding of the terminal, because a program will read it."""
    if sys.stdout.isatty():
        text = printable(text)
    sys.stdout.flush()
    sys.stdout.buffer.write(text.encode())
    sys.stdout.buffer.flush()


def print_plain(text: str) -> None:
    """Print a remark to standard error, so that it does not mix with a file on standard output."""
    echo(text, err=True)
