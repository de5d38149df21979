"""Confirmation before an automatic motion: explain it, and require the user's consent."""

from __future__ import annotations

import sys
from collections.abc import Iterable

import click

from axisbus.cli.shared.common import say
from axisbus.cli.shared.options import Decorated
from axisbus.system.signals import present


def yes_option(function: Decorated) -> Decorated:
    """Add --yes."""
    return click.option("--yes", is_flag=True, help="Skip the confirmation prompt: all conditions are met.")(
        function
    )


def ask(explanation: Iterable[str], *, yes: bool) -> None:
    """Print what will happen, and continue only if the user agrees.

    Raises:
        UsageError: there is no terminal to answer, and ``--yes`` is not given.
        Abort: the user declines.
    """
    for line in explanation:
        say(line)
    if yes:
        return
    if not sys.stdin.isatty():
        raise click.UsageError(
            "no terminal to answer the question: give --yes, if all of these conditions are met"
        )
    click.confirm("Start now?", abort=True)


def end_by(number: int) -> None:
    """End the program as the signal with this number requires; 0: there was no signal.

    Raises:
        KeyboardInterrupt, SystemExit: there was one.
    """
    if number in present("SIGINT", "SIGTSTP"):
        raise KeyboardInterrupt
    if number:
        raise SystemExit(128 + number)
