"""Before something moves by itself: what will happen is explained, and somebody has to say that it may."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterable

import click

from axisbus.cli.shared.common import say
from axisbus.cli.shared.options import Decorated


def yes_option(function: Decorated) -> Decorated:
    """Add --yes."""
    return click.option("--yes", is_flag=True, help="Do not ask: somebody has seen to all of it.")(function)


def ask(explanation: Iterable[str], *, yes: bool) -> None:
    """Print what will happen, and go on only where somebody agrees.

    Raises:
        UsageError: nobody can answer, and ``--yes`` is not given. Abort: somebody says no.
    """
    for line in explanation:
        say(line)
    if yes:
        return
    if not sys.stdin.isatty():
        raise click.UsageError("nobody can answer here: give --yes, if all of this has been seen to")
    click.confirm("Shall it begin?", abort=True)


def end_by(number: int) -> None:
    """Leave as the signal of this number wants it; 0: none came.

    Raises:
        KeyboardInterrupt, SystemExit: one came.
    """
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    if number:
        raise SystemExit(128 + number)
