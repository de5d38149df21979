"""Common parts of the ``od`` subcommands: NODE:OBJECT arguments with their completion, and objects as lines and as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from axisbus.cia301.datatypes import DataType, Value
from axisbus.cli.shared.completion import nodes_and_axes
from axisbus.cli.shared.nodes import Address, NodeFiles
from axisbus.configuration import parse_values
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, AxisbusError
from axisbus.trace import frame_formats as text
from axisbus.trace import value_text
from axisbus.trace.decoded import ObjectValue

if TYPE_CHECKING:
    from axisbus.bus.sdo.access import ByObjects


@dataclass(frozen=True, slots=True)
class ObjectTarget:
    """A requested object of a node; ``words`` is the user's text."""

    address: Address
    entry: DictionaryEntry
    words: str


def split(arguments: tuple[str, ...]) -> list[tuple[str, str]]:
    """Return (node, object) for each argument: NODE:OBJECT, or one NODE followed by objects of it.

    Raises:
        UsageError: a node without an object.
    """
    first = arguments[0] if arguments else ""
    if ":" not in first:
        if len(arguments) < 2:
            raise click.UsageError(
                f"name an object after the node, such as {first or '5'}:6041; all of them: axisbus od dump {first or '5'}"
            )
        return [(first, each) for each in arguments[1:]]
    parts = [each.partition(":") for each in arguments]
    for node, colon, wanted in parts:
        if not colon or not wanted:
            raise click.UsageError(f"{node!r} does not name an object: write NODE:OBJECT, such as 5:6041")
    return [(node, wanted) for node, _, wanted in parts]


def targets(files: NodeFiles, arguments: tuple[str, ...]) -> list[ObjectTarget]:
    """Return the requested objects; a record stands for all of its entries.

    Raises:
        UsageError, ArgumentError: an argument is not NODE:OBJECT, or the node or object does not exist.
    """
    return list(_targets(files, arguments))


def _targets(files: NodeFiles, arguments: tuple[str, ...]) -> Iterator[ObjectTarget]:
    for node, wanted in split(arguments):
        address = files.address(node)
        dictionary = Dictionary(files.eds_for(address.node_id), address.node_id)
        for entry in parse_values.find(dictionary, wanted, address.drive_axis):
            yield ObjectTarget(address, entry, f"{node}:{wanted}")


def value_of(
    files: NodeFiles, node_id: int, dictionary: Dictionary, entry: DictionaryEntry, value: Value
) -> ObjectValue:
    """Return a value with its meaning and its unit."""
    return value_text.value_of(files.quantities, node_id, dictionary, entry, value)


def read(
    files: NodeFiles, node: ByObjects, entry: DictionaryEntry, kind: DataType | None = None
) -> ObjectValue:
    """Read an object; blocks.

    Raises:
        SdoError, BusError: as ``SdoClient.read``.
    """
    value = node.sdo.read(entry.index, entry.subindex, data_type=kind)
    return value_of(files, node.node_id, node.sdo.dictionary, entry, value)


def line(value: ObjectValue) -> str:
    """Return an object and its value as a line."""
    return f"{text.address(value)} = {text.shown(value)}"


def plain(node_id: int, value: ObjectValue) -> dict[str, Any]:
    """Return an object and its value for JSON; bytes as hexadecimal digits."""
    from axisbus.trace import frame_formats as plainly

    return {"node": node_id, **plainly.value(value)}


def kind_of(text: str | None) -> DataType | None:
    """Return the data type of --type; raises ArgumentError if there is no such type."""
    return None if text is None else parse_values.data_type(text)


def may_read(eds: Eds) -> Iterable[tuple[int, int]]:
    """Yield the entries that are safe to read: readable, no DOMAIN, and not refused by their ObjFlags (DS 306 4.6.3.2)."""
    from axisbus.bus.node import verify

    for entry in eds:
        for variable in entry.subs.values():
            if variable.readable and verify.may_read(variable):
                yield variable.index, variable.subindex


# -- completion --------------------------------------------------------------------------------------------------------


def complete(ctx: click.Context, _: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return completions: nodes and axes, then the objects of the node's EDS by name and by index.

    A shell that splits words at the colon (bash) gives NODE and : as separate words; then only the object is completed.
    """
    try:
        files = NodeFiles.of(_path(ctx.params.get("cell")), tuple(ctx.params.get("eds") or ()))
        return list(_complete(files, tuple(ctx.params.get("arguments") or ()), incomplete))
    except (AxisbusError, OSError):
        return []  # a completion cannot report errors; the command itself will


def _path(given: object) -> Path | None:
    return None if given is None else Path(str(given))


def _complete(files: NodeFiles, before: tuple[str, ...], incomplete: str) -> Iterator[CompletionItem]:
    node, colon, part = incomplete.partition(":")
    if not colon and before:
        names = [word for word in before if word != ":"]
        yield from _objects(files, names[0].partition(":")[0], "", incomplete)
    elif colon:
        yield from _objects(files, node, f"{node}:", part)
    else:
        for name, help_text in nodes_and_axes(files.cell):
            if name.startswith(incomplete):
                yield CompletionItem(f"{name}:", help=help_text)


def _objects(files: NodeFiles, node: str, prefix: str, part: str) -> Iterator[CompletionItem]:
    try:
        eds = files.eds_for(files.address(node).node_id)
    except ArgumentError:
        return
    for entry in eds or ():
        name = parse_values.spelling(entry.name)
        if name.lower().startswith(part.lower()) and part:
            yield CompletionItem(f"{prefix}{name}", help=f"{entry.index:04X}h")
        elif f"{entry.index:04X}".startswith(part.upper()):
            yield CompletionItem(f"{prefix}{entry.index:04X}", help=entry.name)
