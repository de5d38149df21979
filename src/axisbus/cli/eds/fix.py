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


class _Done(NamedTuple):
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
    done = [each for file in named if (each := _mended(file, output, write)) is not None]
    if as_json:
        plain = [_plain(each) for each in done]
        say_json(plain[0] if len(named) == len(plain) == 1 else {"files": plain})
    else:
        _say(done)
    if len(done) < len(named):
        return MISUSE  # 1 means that there is something to fix
    return WRONG if any(each.fixed.mended and each.target is None for each in done) else OK


def _mended(file: str, output: Path | None, write: bool) -> _Done | None:
    """Fix one file, and write it if requested; None if it cannot be read, which is reported."""
    path = builtin.resolve(file, Path())
    try:
        before = reader.read(reader.file_bytes(path), str(path))
    except EdsError as error:
        say_error(str(error))
        return None
    fixed = fix.fix(before)
    target = output or (path if write else None)
    if target is not None and (fixed.mended or output is not None):
        write_whole(target, writer.dumps(fixed.reading))
    return _Done(file, before.document, fixed, target)


def _plain(done: _Done) -> dict[str, object]:
    found = [{"rule": each.rule, "line": each.line, "what": each.what} for each in done.fixed.mended]
    return {
        "file": done.file,
        "written": None if done.target is None else str(done.target),
        "mended": found,
    }


def _say(done: list[_Done]) -> None:
    for each in done:
        diff = list(fix.unified(each.before, each.fixed, each.file))
        if diff:
            say_lines(diff)
        _summary(each)
    open_ones = [each.file for each in done if each.fixed.mended and each.target is None]
    if open_ones:
        say_next(f"axisbus eds fix {_few(open_ones)} --write")
    elif done:
        say_next(f"axisbus eds check {_few([str(each.target or each.file) for each in done])}")


def _few(files: list[str]) -> str:
    """Return the files as they have to be typed; only the first ones of many, because the user knows the pattern."""
    return " ".join(files[:_TYPED]) + (" ..." if len(files) > _TYPED else "")


def _summary(done: _Done) -> None:
    mended = done.fixed.mended
    if not mended:
        say(f"{done.file}: nothing to fix")
        return
    for each in mended:
        if not each.changes:  # no line of the diff shows it
            say(f"{done.file}:{each.line}: {each.rule} {each.what}")
    counts = Counter(each.rule for each in mended)
    rules = ", ".join(f"{rule} {count}" for rule, count in sorted(counts.items()))
    many = counted(len(mended), "fix", "fixes")
    if done.target is None:
        say(f"{done.file}: {many} ({rules}), not written")
    else:
        say(f"{done.target}: written with {many} ({rules})")
