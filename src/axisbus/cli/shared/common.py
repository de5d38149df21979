"""Common parts of all subcommands: exit codes, errors as text, JSON, and hints for the next command."""

from __future__ import annotations

import io
import itertools
import json
import logging
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Any

import click

from axisbus.errors import ArgumentError, AxisbusError, UserError, added_notes, help_line
from axisbus.wording import PrintableFormatter, printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


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
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8", newline=""))  # noqa: SIM115  # until the process ends
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
    """Offer ``update(done, all)``, which draws a bar on standard error if it is a terminal; if ``all`` is None, the bar stays."""
    with progress_line(label, quiet=quiet) as line:
        yield None if line is None else line.update


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

    def update(self, done: int, total: int | None) -> None:
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
    """Offer ``update(what, done, all)``, which draws a bar for each phase of a long operation, as ``progress_bar``."""
    now = ""
    with ExitStack() as stack:
        bar = ExitStack()
        update_bar: Callable[[int, int], None] | None = None
        stack.callback(bar.close)

        def update(what: str, done: int, total: int) -> None:
            nonlocal now, update_bar
            if what != now:
                bar.close()
                now, update_bar = what, bar.enter_context(progress_bar(what, quiet=quiet))
            if update_bar is not None:
                update_bar(done, total)
            if done >= total:
                bar.close()  # so that the next output begins a new line
                now = ""

        yield update


def rounds(count: int | None, wait: Callable[[], object]) -> Iterator[None]:
    """Yield ``count`` times (None: without end), and call ``wait`` between two rounds."""
    for number in itertools.count(1):
        yield
        if number == count:
            return
        wait()


def say_json(value: Any) -> None:
    """Print a value as JSON."""
    click.echo(json.dumps(value, indent=2, default=str))


# -- Error texts for the command line: calls in a remedy of the library are replaced by options and commands -----------


_AXIS_IN_TEXT = re.compile(r"([A-Za-z_][\w-]*)(?:\.\w+\(|: )")  # "x.move_absolute(1 deg): ...", or "x: ..."


# How to reopen the machine: by the command itself if it has opened the machine, else by the program that it has joined.
_REPEAT_REMEDY = "if the machine is already running, end it (Ctrl-C in axisbus run) and start it again; then repeat the command"


# Longer patterns first: the shorter ones replace the rest.
_TABLE: tuple[tuple[re.Pattern[str], str], ...] = tuple(
    (re.compile(call), command)
    for call, command in (
        (r"home it \(axis\.home\(\)\) or confirm its position \(axis\.set_position\(\.\.\.\)\)", "add --home"),
        (r"read why \(axis\.error\), then reset it: axis\.reset\(\)", "reset it: axisbus reset CELL AXIS"),
        (r"see why it is in ErrorStop \(axis\.error\)", "see why it is in ErrorStop (axisbus monitor CELL)"),
        (r"\(axis\.disable\(\), axis\.reset\(\), then axis\.enable\(\)\)", "(axisbus stop CELL, then axisbus boot CELL)"),
        (r"enable it again \(axis\.enable\(\)\) or disable it \(axis\.disable\(\)\)", "stop it: axisbus stop CELL"),
        (r"take it over with axis\.enable\(\), or switch it off with axis\.disable\(\)", "switch it off: axisbus stop CELL"),
        # Pairs: only a program can square a skewed beam.
        (r"then (?=(\w+)\.disable\(\), \1\.reset\(\), \1\.enable\(skew=)", "then, in a program, "),
        (r"make the beam square first: ", "make the beam square first, in a program: "),
        (r"; then (?!axis)(\w+)\.reset\(\)", r"; then axisbus reset CELL \1"),
        (r"; or give the position of the beam: \w+\.set_position\(\.\.\.\)", ""),
        (r"axis\.reset\(\) and axis\.enable\(\)", "axisbus reset CELL AXIS"),
        (r"axis\.enable\(allow_moving=True\) catches it in motion; ", ""),
        (r"wait until it is off: axis\.disable\(coast=True\)\.wait\(\)", "wait until it is off"),
        (r"wait for standstill, then release it: axis\.release\(\)", "wait until it is at standstill"),
        (r"enable it first: axis\.enable\(\)", "repeat the command"),
        (r"axis\.reset\(\)", "axisbus reset CELL AXIS"),
        (r"axis\.home\(\)", "axisbus home CELL AXIS"),
        (r"axis\.(?:halt|stop|quick_stop|disable|release)\(\)", "axisbus stop CELL"),
        (r"axis\.enable\(\)", "axisbus move CELL AXIS=..., which enables it"),
        (r"axis\.position", "the position of the axis"),
        (r"axis\.error", "axisbus monitor CELL"),
        (r"; axis\.snapshot has the last known values, with their time", ""),
        (r"machine\.node\(ID\)\.sdo\[(0x)?(\w+)\]", r"axisbus od read ID:\2"),
        (r"Machine\.open\(\.\.\., allow_other_master=True\) or ", "or "),
        (r"--beside, or ", "--beside, or "),
        (r"open the machine with Machine\.open and .* instead of Machine\.simulated", "boot it: axisbus boot CELL"),
        (r"give (velocity|acceleration|timeout) = \.\.\.(?: \(seconds\))? in the call", r"give --\1"),
        (r"give \w+ = \.\.\.(?: \([^)]*\))? in the call, or", "write"),
        (r"the call does not give it, and", "no option gives it, and"),
        (r"(then )?close the machine,? (?:and|which)[^;]*", rf"\1{_REPEAT_REMEDY}"),
        (r"; in a program: \S+\(\w+\)\.(?:command\(NmtCommand\.START\)|boot\(\))", ""),
        (r"; in a program: machine\.reconnect\(\)", ""),
        (r"--cell CELL", "--cell CELL"),
        (r"(?:close it, and )?open (?:the machine|it) again(?: to continue)?", "repeat the command"),
        (r"Machine\.attach\(cell, command=True, force=True\)", "--take"),
        (r"; or open the cell in this program: Machine\.open", ""),
        (r"read it while the machine is open", "repeat the command"),
    )
)  # fmt: skip
# A bus that was given by options has no [bus] table.
_WITHOUT_CELL: tuple[tuple[re.Pattern[str], str], ...] = (
    (
        re.compile(r"write the bus's rate, such as bitrate = ([\d_]+), in \[bus\]"),
        r"give the bus's rate with -b",
    ),
    (re.compile(r"correct bitrate in \[bus\]"), "give the link's with -b"),
    (re.compile(r" \(\[bus\.options\]\)"), " (-O)"),
    (re.compile(r"interface = \"socketcan\""), "-i socketcan"),
)


def with_page(error: BaseException) -> str:
    """Return the texts of an error as ``in_commands``, and the command for the page of its symptom, if it has one."""
    page = f"\n{help_line(error)}" if isinstance(error, AxisbusError) else ""
    return in_commands(error) + page


def in_commands(error: BaseException) -> str:
    """Return the texts of an error; calls in them are replaced by commands."""
    text = str(error)
    axis_match = _AXIS_IN_TEXT.match(text)
    cell = next((each for each in sys.argv[1:] if each.endswith(".toml")), "")
    for pattern, command in (*_TABLE, *(() if cell else _WITHOUT_CELL)):
        command = command.replace("CELL", cell or "cell.toml").replace(
            "AXIS", axis_match[1] if axis_match else "AXIS"
        )
        text = pattern.sub(_literal(command), text)
    return text


def _literal(command: str) -> str:
    """Escape the backslashes of a Windows path for a regular expression's replacement."""
    return re.sub(r"\\(?!\d)", r"\\\\", command)


# -- Coloured output on a terminal, plain output everywhere else; NO_COLOR disables colours (no-color.org) -------------


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
