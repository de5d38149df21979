"""Common parts of all subcommands: exit codes, errors as text, JSON, and hints for the next command."""

from __future__ import annotations

import io
import json
import logging
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import click

from axisbus.cli.shared.error_text import with_page
from axisbus.errors import ArgumentError, AxisbusError, UserError, added_notes
from axisbus.wording import PrintableFormatter, printable

OK, WRONG, MISUSE, FAILURE = 0, 1, 2, 3


def run(command: click.Command) -> int:
    """Run ``command`` with the arguments of the process; return the exit code."""
    _make_printable()
    if logging.lastResort is not None:  # writes warnings to standard error if no log is set up
        logging.lastResort.setFormatter(PrintableFormatter())
    try:
        # None: coloured if the output is a terminal
        plain = False if os.environ.get("NO_COLOR") else None
        result = command.main(prog_name="axisbus", standalone_mode=False, color=plain)
    except click.exceptions.Abort as error:  # click raises it for Ctrl-C, which is then its cause
        say_error("stopped")
        _say_notes(error.__cause__)
        return 130
    except click.ClickException as error:
        error.show()
        _say_notes(error)
        return MISUSE
    except ExceptionGroup as group:
        return _report([group])
    except AxisbusError as error:
        return _report([error])
    except KeyboardInterrupt as error:
        say_error("stopped by Ctrl-C")
        _say_notes(error)
        return 130
    except OSError as error:
        return _unusable(error)
    return result if isinstance(result, int) else OK


def _make_printable() -> None:
    """Make all text printable: escape characters that an output does not support, and discard the output if it is closed."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the shell (>&-)
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115  # until the process ends
        elif isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "surrogateescape"):
            stream.reconfigure(errors="backslashreplace")


def _unusable(error: OSError) -> int:
    """Report a failure of a file or an output, such as a full disk; commands report the failures that they expect themselves."""
    named = error.filename if error.filename is not None else "the output"
    why = str(error) if error.errno is None else f"{named} cannot be used: {error.strerror}"
    with suppress(OSError):  # standard error may be what failed
        say_error(why)
        _say_notes(error)
    return FAILURE


def _say_notes(error: BaseException | None) -> None:
    """Print further errors, such as a stop at the end that could not be confirmed."""
    for note in [] if error is None else added_notes(error):
        say_error(note)


def _report(errors: Any) -> int:
    code = OK
    for error in errors:
        if isinstance(error, ExceptionGroup):
            code = max(code, _report(error.exceptions))
            _say_notes(error)
            continue
        if not isinstance(error, AxisbusError):
            raise error
        say_error(with_page(error))
        code = max(code, exit_code(error))
    return code


def exit_code(error: AxisbusError) -> int:
    """Return the exit code for an error."""
    if isinstance(error, ArgumentError):
        return MISUSE
    return WRONG if isinstance(error, UserError) else FAILURE


def echo(text: str, *, err: bool = False, nl: bool = True) -> None:
    """Print a text that may contain foreign names: control characters are shown, not executed."""
    click.echo(printable(text), err=err, nl=nl)


def say(text: str = "") -> None:
    """Print a line for the user immediately."""
    echo(text)


def say_error(text: str) -> None:
    """Print an error to standard error."""
    echo(f"axisbus: {text}", err=True)


def misuse(message: str) -> int:
    """Report an error in the command line; return its exit code."""
    say_error(message)
    return MISUSE


def say_note(text: str) -> None:
    """Print a remark to standard error, above a progress bar if one is drawn there."""
    text = printable(text)
    click.echo(f"\r\x1b[K{text}" if sys.stderr.isatty() else text, err=True)


def say_next(text: str) -> None:
    """Print the next command to type."""
    if sys.stdout.isatty() or not sys.stdout.closed:
        echo(f"next: {text}")


@contextmanager
def progress_bar(label: str, *, quiet: bool = False) -> Iterator[Callable[[int, int | None], None] | None]:
    """Offer ``tell(done, all)``, which draws a bar on standard error if it is a terminal; if ``all`` is None, the bar stays."""
    with progress_line(label, quiet=quiet) as line:
        yield None if line is None else line.tell


@contextmanager
def progress_line(label: str, *, quiet: bool = False) -> Iterator[ProgressLine | None]:
    """Offer a bar as ``progress_bar``, whose label may change."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    with click.progressbar(length=1000, label=printable(label), file=sys.stderr) as bar:
        yield ProgressLine(bar)


class ProgressLine:
    """A progress bar on standard error; holds the progress."""

    def __init__(self, bar: Any) -> None:
        self._bar = bar
        self._shown = 0

    def tell(self, done: int, total: int | None) -> None:
        """Draw the progress; if ``total`` is None, the bar stays."""
        if total is None:
            return
        now = done * 1000 // max(1, total)
        self._bar.update(now - self._shown)
        self._shown = now

    def label(self, text: str) -> None:
        """Set the text before the bar."""
        if self._bar.label != printable(text):
            self._bar.label = printable(text)
            self._bar.render_progress()


@contextmanager
def progress_phases(*, quiet: bool = False) -> Iterator[Callable[[str, int, int], None]]:
    """Offer ``tell(what, done, all)``, which draws a bar for each phase of a long operation, as ``progress_bar``."""
    now = ""
    with ExitStack() as stack:
        bar = ExitStack()
        draw: Callable[[int, int], None] | None = None
        stack.callback(bar.close)

        def tell(what: str, done: int, total: int) -> None:
            nonlocal now, draw
            if what != now:
                bar.close()
                now, draw = what, bar.enter_context(progress_bar(what, quiet=quiet))
            if draw is not None:
                draw(done, total)
            if done >= total:
                bar.close()  # so that the next output begins a new line
                now = ""

        yield tell


def say_json(value: Any) -> None:
    """Print a value as JSON."""
    click.echo(json.dumps(value, indent=2, default=str))
