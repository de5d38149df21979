"""``axisbus eds code``: a typed Python module of the objects, or a C header of them and of the PDOs."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.eds.files import file_argument, node_of, node_option, open_eds, say_text
from axisbus.cli.shared.common import OK, say, say_next
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.eds.report import codegen, header
from axisbus.errors import ArgumentError
from axisbus.wording import counted


@click.command("code")
@file_argument
@output_option("Where to write [default: standard output].")
@force_option
@node_option
@click.option("--c", "as_c", is_flag=True, help="Write a C header instead, with the layouts of the PDOs.")
def command(file: str, output: Path | None, force: bool, node: int | None, as_c: bool) -> int:
    """Write a Python module of the objects of FILE (an EDS, a DCF or builtin:NAME): typed constants and enumerations.

    To standard output, or with -o to a file. The module imports nothing of axisbus; the same file gives the same text. With --node,
    defaults are those for this node ID. With --c a header for C99 and C++: where each object is, its type, and for each PDO of the
    file a structure with what reads and makes its data.
    """
    _require_name(output, as_c=as_c)
    require_free(output, force=force)
    eds = open_eds(file)
    text = (header.header if as_c else codegen.module)(eds, node_of(eds, node))
    if output is None:
        say_text(text)
        return OK
    write_whole(output, text.encode())
    entries = sum(len(entry.subs) for entry in eds)
    say(f"{output}: written, {counted(len(eds.objects), 'object')}, {counted(entries, 'entry', 'entries')}")
    say_next(
        f'in C: #include "{output.name}"' if as_c else f"in Python: from {output.stem} import Index, ENTRIES"
    )
    return OK


def _require_name(output: Path | None, *, as_c: bool) -> None:
    if output is None:
        return
    if as_c and output.suffix not in (".h", ".hpp"):
        raise ArgumentError(f"{output.name} is no name of a C header", remedy="give one such as -o drive.h")
    if not as_c and not (output.suffix == ".py" and output.stem.isidentifier()):
        raise ArgumentError(
            f"{output.name} is no name of a Python module", remedy="give one such as -o drive.py"
        )
