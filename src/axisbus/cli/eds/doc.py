"""``axisbus eds doc``: write a complete reference of the device."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.eds.files import file_argument, node_of, node_option, open_eds
from axisbus.cli.shared.common import OK, say, say_next
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.eds.checking import check
from axisbus.eds.device_doc import html, markdown, reference
from axisbus.errors import ArgumentError
from axisbus.wording import counted

_WRITERS = {".html": html, ".htm": html, ".md": markdown, ".markdown": markdown}


@click.command("doc")
@file_argument
@output_option("Where to write [default: the name of FILE with .html].")
@force_option
@node_option
def command(file: str, output: Path | None, force: bool, node: int | None) -> int:
    """Write a complete reference of the device of FILE (an EDS, a DCF or builtin:NAME): every object, the PDOs drawn.

    -o names the file, x.html (one self-contained page, also suited for printing) or x.md; without it, the name of FILE with
    .html in this folder. With --node, values are those for this node ID.
    """
    require_free(output, force=force)
    eds = open_eds(file)
    if output is None:
        output = Path(f"{Path(eds.source).stem}.html")
        require_free(output, force=force)
    writer = _WRITERS.get(output.suffix.lower())
    if writer is None:
        raise ArgumentError(f"{output}: no such format", remedy="give a name that ends in .html or .md")
    page = reference(eds, node_of(eds, node), check(eds))
    write_whole(output, writer(page).encode())
    entries = sum(len(entry.subs) for entry in eds)
    say(
        f"{output}: written, {counted(len(eds.objects), 'object')}, {counted(entries, 'entry', 'entries')}, {page.verdict}"
    )
    say_next(f"open {output} in a browser" if writer is html else f"axisbus eds show {file}")
    return OK
