"""Common parts of the ``config`` subcommands: reading DCFs, the EDS of a node, objects on the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from axisbus.cli.shared.common import progress_bar
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions
from axisbus.eds import builtin, writer
from axisbus.eds.io import reader
from axisbus.eds.io.reader import EdsParseResult
from axisbus.errors import ArgumentError

if TYPE_CHECKING:
    from axisbus.bus.sdo.access import ByObjects


Key = tuple[int, int]


OnProgress = Callable[[int, int], None]


def read_file(spec: str | Path) -> EdsParseResult:
    """Read a DCF or EDS (a path, or ``builtin:NAME``).

    Raises:
        EdsError: the file cannot be read, or is neither.
    """
    path = builtin.resolve(str(spec), Path())
    return reader.read(reader.file_bytes(path), str(path))


def eds_file(files: NodeFiles, node_id: int) -> str:
    """Return the EDS that the user gave for a node, by --eds, else by the cell file; empty if there is none."""
    found = files.eds_for(node_id)
    return found.source if found is not None else ""


def node_reading(files: NodeFiles, node: ByObjects) -> tuple[EdsParseResult, str]:
    """Return the EDS of a node and its origin: given by the user, stored in the node (1021h), else a skeleton.

    Blocks for long if the node itself is read.

    Raises:
        EdsError: a file cannot be read.
        SdoError, AdapterError: the node does not answer.
    """
    given = eds_file(files, node.node_id)
    if given:
        return read_file(given), given
    from axisbus.bus.node.from_device import skeleton, stored_eds

    with progress_bar(f"asking node {node.node_id} for its objects") as on_progress:
        data = stored_eds(node.sdo)
        if data is not None:
            return reader.read(data, f"1021h of node {node.node_id}"), "the EDS that the drive stores (1021h)"
        skeleton_text = writer.dumps(skeleton(node.sdo, on_progress))
    what = "a skeleton of the standard objects that exist in it (no maker's objects: give --eds)"
    return reader.read(skeleton_text, f"skeleton of node {node.node_id}"), what


def baudrate(options: NodeOptions, files: NodeFiles, reading: EdsParseResult) -> int | None:
    """Return the bus's bit rate in kbit/s for a DCF; None if it is unknown, or the EDS does not list it."""
    from axisbus.bus.link.listen import link_bitrate
    from axisbus.configuration.dcf_backup import known_rate

    cell = files.cell.bus.bitrate if files.cell is not None else None
    return known_rate(
        reading, options.bitrate or cell or link_bitrate(options.interface or "", options.channel)
    )


def keys(texts: tuple[str, ...], option: str) -> frozenset[Key]:
    """Return the objects of an option, each by index and sub-index (6098, 607D:1).

    Raises:
        ArgumentError: one has another form.
    """
    return frozenset(_key(text, option) for text in texts)


def _key(text: str, option: str) -> Key:
    index, _, sub = text.partition(":")
    try:
        found = int(index.removesuffix("h"), 16), int(sub or "0", 16)
    except ValueError:
        found = (-1, -1)
    if not (0 <= found[0] <= 0xFFFF and 0 <= found[1] <= 0xFF):
        raise ArgumentError(
            f"{option} {text!r} does not name an object",
            remedy=f"write index and sub-index in hexadecimal, such as {option} 6098 or {option} 607D:1",
        )
    return found
