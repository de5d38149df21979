"""``axisbus eds fix``: safe mends, shown as a diff."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import click

from axisbus.cli.common import MISUSE, OK, WRONG, say, say_error, say_json, say_next
from axisbus.cli.eds_files import file_argument, say_lines
from axisbus.cli.output import output_option, write_whole
from axisbus.eds import builtin, fix, fix_diff, reader, writer
from axisbus.errors import EdsError
from axisbus.wording import counted


@click.command("fix")
@file_argument
@output_option("Write the mended file here; FILE stays.")
@click.option("--write", is_flag=True, help="Write the mended text into FILE itself, whole or not at all.")
@click.option("--json", "as_json", is_flag=True, help="Print what is mended as JSON.")
def command(file: str, output: Path | None, write: bool, as_json: bool) -> int:
    """Mend in FILE what can be mended safely, and show it as a diff; nothing is written without --write or -o.

    Mended are counts (SupportedObjects, SubNumber, NrOfEntries, Lines), the numbering of lists, $NODEID, negative numbers in
    hexadecimal, numbers as programs write them, misspelt names, comments in the wrong place, and what is there twice word for
    word. All else stays as it is, byte for byte. What needs judgement is left to you: axisbus eds check.

    Exit codes: 0 nothing to mend, or mended and written; 1 there is something to mend; 2 the file cannot be read.
    """
    path = builtin.resolve(file, Path())
    try:
        before = reader.read(reader.file_bytes(path), str(path))
    except EdsError as error:
        say_error(str(error))
        return MISUSE  # 1 says that there is something to mend
    fixed = fix.fix(before)
    target = output or (path if write else None)
    if target is not None and (fixed.mended or output is not None):
        write_whole(target, writer.dumps(fixed.reading))
    if as_json:
        say_json(_plain(file, fixed, target))
    else:
        diff = list(fix_diff.unified(before.document, fixed, file))
        if diff:
            say_lines(diff)
        _summary(file, fixed, target)
    return OK if target is not None or not fixed.mended else WRONG


def _plain(file: str, fixed: fix.Fixed, target: Path | None) -> dict[str, object]:
    found = [{"rule": each.rule, "line": each.line, "what": each.what} for each in fixed.mended]
    return {"file": file, "written": None if target is None else str(target), "mended": found}


def _summary(file: str, fixed: fix.Fixed, target: Path | None) -> None:
    if not fixed.mended:
        say(f"{file}: nothing to mend")
        say_next(f"axisbus eds check {file}")
        return
    for each in fixed.mended:
        if not each.changes:  # no line shows it
            say(f"{file}:{each.line}: {each.rule} {each.what}")
    counts = Counter(each.rule for each in fixed.mended)
    rules = ", ".join(f"{rule} {count}" for rule, count in sorted(counts.items()))
    many = counted(len(fixed.mended), "mend")
    if target is None:
        say(f"{file}: {many} ({rules}), not written")
        say_next(f"axisbus eds fix {file} --write")
    else:
        say(f"{target}: written with {many} ({rules})")
        say_next(f"axisbus eds check {target}")
