"""``axisbus eds code``: generate a typed Python module of the objects, or a C header of them and of the PDOs."""

from __future__ import annotations

import keyword
from pathlib import Path

import click

from axisbus.cli.eds.files import node_of, node_option, open_eds, say_text
from axisbus.cli.shared.common import OK
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import force_option, output_option, require_free, write_and_say
from axisbus.eds.report import codegen, header, overview
from axisbus.errors import ArgumentError
from axisbus.wording import counted


@click.command("code")
@click.argument("file", required=False)
@output_option("Where to write [default: standard output].")
@force_option
@node_option
@click.option("--c", "as_c", is_flag=True, help="Write a C header instead, with the layouts of the PDOs.")
@click.option("--cell", type=PATH, help="With --c, instead of FILE: the PDOs as planned by this cell file.")
@click.option(
    "--axis", metavar="NAME", help="With --cell: only for the node of this axis; --node selects a node, too."
)
def command(
    file: str | None,
    output: Path | None,
    force: bool,
    node: int | None,
    as_c: bool,
    cell: Path | None,
    axis: str | None,
) -> int:
    """Write a Python module for the objects of FILE (an EDS, a DCF or builtin:NAME): typed constants and enumerations.

    Writes to standard output, or with -o to a file. The module does not import axisbus; the same file gives the same text. With
    --node, defaults are those for this node ID. With --c, it writes a header for C99 and C++: the location and type of each
    object, and for each PDO of the file a structure with functions that decode and encode its data. With --cell, the PDOs are
    those used after boot-up, node by node.
    """
    _require_source(file, cell, axis, as_c=as_c, node=node)
    _require_name(output, as_c=as_c)
    require_free(output, force=force)
    text, described = _of_file(file, node, as_c=as_c) if file is not None else _of_cell(cell, node, axis)
    if output is None:
        say_text(text)
        return OK
    next_step = (
        f'in C: #include "{output.name}"' if as_c else f"in Python: from {output.stem} import Index, ENTRIES"
    )
    write_and_say(output, text.encode(), f"written, {described}", next_step)
    return OK


def _of_file(file: str, node: int | None, *, as_c: bool) -> tuple[str, str]:
    """Return the text, and a description of its contents for people."""
    eds = open_eds(file)
    return (header.header if as_c else codegen.module)(eds, node_of(eds, node)), overview.contents(eds)


def _of_cell(cell: Path | None, node: int | None, axis: str | None) -> tuple[str, str]:
    from axisbus.cli.eds.code_cell import nodes_of

    assert cell is not None
    nodes = nodes_of(cell, node, axis)
    pdos = sum(len(each.pdos) for each in nodes)
    return header.of_cell(cell.name, nodes), f"{counted(len(nodes), 'node')}, {counted(pdos, 'PDO')}"


def _require_source(
    file: str | None, cell: Path | None, axis: str | None, *, as_c: bool, node: int | None
) -> None:
    if (file is None) == (cell is None):
        raise ArgumentError(
            "no input is given" if file is None else "both a file and --cell are given",
            remedy="give an EDS, a DCF or builtin:NAME; or --c --cell cell.toml",
        )
    if cell is not None and not as_c:
        raise ArgumentError(
            "a Python module cannot contain the PDOs of a cell", remedy="give --c for a C header"
        )
    if axis is not None and (cell is None or node is not None):
        raise ArgumentError(
            "--axis needs --cell, and excludes --node",
            remedy="give it with --cell and without --node; or leave it out",
        )


def _require_name(output: Path | None, *, as_c: bool) -> None:
    if output is None:
        return
    if as_c and output.suffix not in (".h", ".hpp"):
        raise ArgumentError(
            f"{output.name} is not the name of a C header", remedy="give one, such as -o drive.h"
        )
    if not as_c and not (output.suffix == ".py" and _is_importable(output.stem)):
        raise ArgumentError(
            f"{output.name} is not the name of a Python module", remedy="give one, such as -o drive.py"
        )


def _is_importable(name: str) -> bool:
    return name.isidentifier() and not keyword.iskeyword(name)
