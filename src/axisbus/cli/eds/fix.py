"""``axisbus eds fix``: safe fixes, shown as a diff."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import click

from axisbus.cli.eds.files import expanded, say_lines
from axisbus.cli.shared.common import MISUSE, OK, WRONG, misuse, say, say_error, say_json, say_next
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.eds import builtin, fix, writer
from axisbus.eds.io import reader
from axisbus.eds.io.text import EdsText
from axisbus.errors import EdsError
from axisbus.wording import counted

_TYPED = 5  # the most files named in a hint


class _FixedFile(NamedTuple):
    """One file before and after fixing, and where it was written (None: nowhere)."""

    file: str
    before: EdsText
    fixed: fix.Fixed
    target: Path | None


@click.command("fix")
@click.argument("files", nargs=-1)
@output_option("Write the fixed file here; FILE is not changed. For one file only.")
@force_option
@click.option("--write", is_flag=True, help="Replace each file by its fixed text, completely or not at all.")
@click.option("--json", "as_json", is_flag=True, help="Print the fixes as JSON.")
def command(files: tuple[str, ...], output: Path | None, force: bool, write: bool, as_json: bool) -> int:
    """Fix in FILES (EDS, DCF, or patterns such as 'eds/*.eds') the errors that can be fixed safely, and show a diff; nothing is
    written without --write or -o.

    It fixes counts (SupportedObjects, SubNumber, NrOfEntries, Lines), the numbering of lists, $NODEID, negative numbers in
    hexadecimal, numbers in the notation of programming languages, misspelt names, an incomplete [DummyUsage], names and
    comments beyond ASCII, misplaced comments, and literal duplicates. Everything else remains as it is, byte for byte. Findings
    that need judgement are left to you: axisbus eds check.

    Exit codes: 0 nothing to fix, or fixed and written; 1 there is something to fix; 2 a file cannot be read, or wrong use.
    """
    named = list(expanded(files))
    if not named:
        return misuse("no file is given, such as: axisbus eds fix drive.eds")
    if output is not None and (write or len(named) > 1):
        return misuse("-o is for one file, and excludes --write: give --write to fix each file in place")
    require_free(output, force=force)
    results = [each for file in named if (each := _fix_file(file, output, write)) is not None]
    if as_json:
        plain = [_plain(each) for each in results]
        say_json(plain[0] if len(named) == len(plain) == 1 else {"files": plain})
    else:
        _print_results(results)
    if len(results) < len(named):
        return MISUSE  # 1 means that there is something to fix
    return WRONG if any(each.fixed.fixes and each.target is None for each in results) else OK


def _fix_file(file: str, output: Path | None, write: bool) -> _FixedFile | None:
    """Fix one file, and write it if requested; None if it cannot be read, which is reported."""
    path = builtin.resolve(file, Path())
    try:
        before = reader.read(reader.file_bytes(path), str(path))
    except EdsError as error:
        say_error(str(error))
        return None
    fixed = fix.fix(before)
    target = output or (path if write else None)
    if target is not None and (fixed.fixes or output is not None):
        write_whole(target, writer.dumps(fixed.reading))
    return _FixedFile(file, before.document, fixed, target)


def _plain(result: _FixedFile) -> dict[str, object]:
    found = [{"rule": each.rule, "line": each.line, "what": each.what} for each in result.fixed.fixes]
    return {
        "file": result.file,
        "written": None if result.target is None else str(result.target),
        "mended": found,
    }


def _print_results(results: list[_FixedFile]) -> None:
    for each in results:
        diff = list(fix.unified(each.before, each.fixed, each.file))
        if diff:
            say_lines(diff)
        _summary(each)
    unwritten = [each.file for each in results if each.fixed.fixes and each.target is None]
    if unwritten:
        say_next(f"axisbus eds fix {_first_names(unwritten)} --write")
    elif results:
        say_next(f"axisbus eds check {_first_names([str(each.target or each.file) for each in results])}")


def _first_names(files: list[str]) -> str:
    """Return the files as they have to be typed; only the first ones of many, because the user knows the pattern."""
    return " ".join(files[:_TYPED]) + (" ..." if len(files) > _TYPED else "")


def _summary(result: _FixedFile) -> None:
    fixes = result.fixed.fixes
    if not fixes:
        say(f"{result.file}: nothing to fix")
        return
    for each in fixes:
        if not each.changes:  # no line of the diff shows it
            say(f"{result.file}:{each.line}: {each.rule} {each.what}")
    counts = Counter(each.rule for each in fixes)
    rules = ", ".join(f"{rule} {count}" for rule, count in sorted(counts.items()))
    count_text = counted(len(fixes), "fix", "fixes")
    if result.target is None:
        say(f"{result.file}: {count_text} ({rules}), not written")
    else:
        say(f"{result.target}: written with {count_text} ({rules})")
