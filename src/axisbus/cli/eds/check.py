"""``axisbus eds check``: find the errors in a file, with their locations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import click

from axisbus.cli.eds import check_text as text
from axisbus.cli.eds.files import expanded, say_lines
from axisbus.cli.shared.common import OK, WRONG, misuse, progress_bar, say_json, say_next
from axisbus.eds import builtin, checking
from axisbus.eds.model import EdsFinding, Severity
from axisbus.eds.rules import engine, sarif, table
from axisbus.eds.rules.table import Rule, rules
from axisbus.errors import EdsError
from axisbus.version import __version__

_FAILING = {
    "error": {Severity.ERROR},
    "warning": {Severity.ERROR, Severity.WARNING},
    "note": set(Severity),
}
_MANY = 10  # files; with more, a progress bar is shown
_Found = dict[str, tuple[EdsFinding, ...]]
_Show = Callable[[str, Iterable[EdsFinding]], Iterable[str]]


def _severities(_: click.Context, __: click.Parameter, given: tuple[str, ...]) -> frozenset[Severity]:
    """Return the requested severities, all if none is given."""
    words = [word.strip().lower() for word in ids_of(given)]
    try:
        return frozenset(map(Severity, words)) or frozenset(Severity)
    except ValueError:
        raise click.BadParameter(
            f"give {', '.join(one.value for one in Severity)}, with commas between several"
        ) from None


@click.command("check")
@click.argument("files", nargs=-1)
@click.option(
    "--select",
    multiple=True,
    metavar="IDS",
    help="Apply only these rules: V003, or V for all rules of V; commas between several.",
)
@click.option(
    "--ignore",
    multiple=True,
    metavar="IDS",
    help="Do not apply these rules; if --select matches a rule as well, the longer text decides.",
)
@click.option(
    "--fail-on",
    type=click.Choice(list(_FAILING)),
    default="error",
    show_default=True,
    help="Exit with 1 for findings of this severity or worse.",
)
@click.option(
    "--severity",
    "shown",
    multiple=True,
    metavar="WORDS",
    callback=_severities,
    help="Show only these: error, warning, note; commas between several. --json and --sarif always have all.",
)
@click.option("--all", "each", is_flag=True, help="Show every finding, not only the first ones of each rule.")
@click.option(
    "--lines", "as_lines", is_flag=True, help="One line each as file:line:column: ..., for editors."
)
@click.option("--json", "as_json", is_flag=True, help="Print all findings as JSON.")
@click.option("--sarif", "as_sarif", is_flag=True, help="Print all findings as SARIF 2.1.0, for code hosts.")
@click.option("--explain", metavar="ID", help="Explain a rule; nothing is checked.")
@click.option(
    "--list", "as_list", is_flag=True, help="List all rules (that are selected); nothing is checked."
)
def command(
    files: tuple[str, ...], select: tuple[str, ...], ignore: tuple[str, ...], fail_on: str,
    shown: frozenset[Severity], each: bool, as_lines: bool, as_json: bool, as_sarif: bool,
    explain: str | None, as_list: bool,
) -> int:  # fmt: skip
    """Check FILES (EDS, DCF, builtin:NAME, or patterns such as 'eds/*.eds') by CiA DS 306, CiA 301 and CiA 402.

    An error makes a tool or the device fail, a warning deviates from the standard, a note is useful to know. For each file, the
    report lists the broken rules, with the number of findings, the remedy, and line and column of the first findings. --all
    shows every finding, and --explain describes a rule.

    Exit codes: 0 no finding of the severity of --fail-on or worse (shown or not), 1 there is one, or a file cannot be read, 2
    wrong use.
    """
    wanted = table.chooser(ids_of(select), ids_of(ignore))
    if explain is not None:
        return explain_rule(explain, rules())
    if as_list:
        return list_rules(
            [rule for rule in rules().values() if wanted(rule.id)], "axisbus eds check", as_json
        )
    if as_json and as_sarif:
        return misuse("--json and --sarif exclude each other: give one of them")
    if not files:
        return misuse("no file is given, such as: axisbus eds check drive.eds (or --list, --explain ID)")
    found = _check_all(files, wanted, None if as_json or as_sarif else _shower(shown, each, as_lines))
    if as_json:
        say_json(text.plain(found))
    elif as_sarif:
        say_json(sarif.log(found, __version__, Path.cwd()))
    else:
        say_lines(text.summary(found, shown), styled=True)
        say_next(text.next_step(found))
    failing = _FAILING[fail_on]
    return WRONG if any(one.severity in failing for every in found.values() for one in every) else OK


def _shower(shown: frozenset[Severity], each: bool, as_lines: bool) -> _Show:
    """Return a function that formats the findings of a file as lines."""

    def show(file: str, findings: Iterable[EdsFinding]) -> Iterable[str]:
        visible = [finding for finding in findings if finding.severity in shown]
        if not visible:
            return ()
        return text.lines(file, visible) if as_lines else text.grouped(file, visible, each=each)

    return show


def _check_all(files: Iterable[str], wanted: Callable[[str], bool], show: _Show | None) -> _Found:
    """Return the findings in each file; ``show`` formats them, so that each file is printed as soon as it is checked."""
    found: _Found = {}
    named = list(expanded(files))
    with progress_bar("checking", quiet=show is not None or len(named) < _MANY) as tell:
        for number, file in enumerate(named, 1):
            found[file] = _check(file, wanted)
            if show is not None and (shown := list(show(file, found[file]))):
                say_lines(shown, styled=True)
            if tell is not None:
                tell(number, len(named))
    return found


def _check(file: str, wanted: Callable[[str], bool]) -> tuple[EdsFinding, ...]:
    try:
        return engine.check(checking.reading(builtin.resolve(file, Path())), wanted)
    except EdsError as error:
        return (engine.unreadable(error),)


def explain_rule(rule: str, known: Mapping[str, Rule]) -> int:
    """Print the explanation of a rule; return the exit code."""
    found = table.RuleIds(known).starting(rule)
    if len(found) != 1:
        there = f"rules that begin so: {', '.join(found)}" if found and rule else "all rules: --list"
        return misuse(f"--explain: {rule[:20]!r} is not the id of a rule; {there}")
    say_lines(text.explained(known[found[0]]), styled=True)
    return OK


def list_rules(chosen: list[Rule], command: str, as_json: bool) -> int:
    """Print rules, and the command that explains one; return the exit code."""
    if as_json:
        say_json({"rules": [text.plain_rule(rule) for rule in chosen]})
    else:
        say_lines(text.listed(chosen), styled=True)
        say_next(f"{command} --explain ID")
    return OK


def ids_of(given: Iterable[str]) -> list[str]:
    """Return the ids of a repeatable option, each of which may have several, separated by commas."""
    return [text for each in given for text in each.split(",")]
