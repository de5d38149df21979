"""Shell completion: nodes and axes of the cell file, its groups and pairs, CAN interfaces and their channels."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from axisbus.cell.model import CellConfig

Items = list[CompletionItem]


def complete_axes(ctx: click.Context, _: click.Parameter, incomplete: str) -> Items:
    """Return the axes, groups and pairs that are not named yet."""
    cell = _cell(ctx)
    named = ctx.params.get("axes") or ()
    return _fitting(incomplete, [each for each in _axes_and_groups(cell) if each[0] not in named])


def complete_targets(ctx: click.Context, _: click.Parameter, incomplete: str) -> Items:
    """Return the axes and pairs without a target, each with its ``=``; not the axes of a pair, which move together."""
    cell = _cell(ctx)
    named = {each.partition("=")[0] for each in ctx.params.get("targets") or ()}
    sides = {name for pair in cell.gantries.values() for name in pair.axes} if cell is not None else set()
    axes = [axis for axis in cell.axes.values() if axis.name not in sides] if cell is not None else []
    found = [
        (f"{axis.name}=", _range(axis.position_limits, axis.unit)) for axis in axes if axis.name not in named
    ]
    found += [(f"{name}=", text) for name, text in _pairs(cell) if name not in named]
    return _fitting(incomplete, found)


def complete_node(ctx: click.Context, _: click.Parameter, incomplete: str) -> Items:
    """Return the nodes and axes of the cell file."""
    return _fitting(incomplete, nodes_and_axes(_cell(ctx)))


def complete_nodes_or_all(ctx: click.Context, _: click.Parameter, incomplete: str) -> Items:
    """Return the nodes and axes of the cell file, and the word for all of them."""
    return _fitting(incomplete, [*nodes_and_axes(_cell(ctx)), ("all", "every node of the bus")])


def complete_interface(_: click.Context, __: click.Parameter, incomplete: str) -> Items:
    """Return python-can's interfaces, and the simulated one."""
    from axisbus.bus.link.adapter import interfaces

    simulated = ("sim", "simulated nodes of a cell file, which -c names")
    return _fitting(incomplete, [*((name, "") for name in interfaces()), simulated])


def complete_channel(ctx: click.Context, _: click.Parameter, incomplete: str) -> Items:
    """Return the CAN interfaces of this computer, if the interface is SocketCAN."""
    from axisbus.bus.link.socketcan import links

    known = ctx.params.get("interface") in (None, "socketcan")
    return _fitting(incomplete, [(name, "") for name in links()] if known else [])


def _cell(ctx: click.Context) -> CellConfig | None:
    """Read the named cell file; ignore its errors, because only the command itself can report them."""
    given = ctx.params.get("cell")
    if given is None:
        return None
    from axisbus.cell import reader

    return reader.read(Path(str(given)))[0]


def _axes_and_groups(cell: CellConfig | None) -> Iterator[tuple[str, str]]:
    yield from _axes(cell)
    for name, group in cell.groups.items() if cell is not None else ():
        yield name, f"group of {', '.join(group.axes)}"
    yield from _pairs(cell)


def _pairs(cell: CellConfig | None) -> Iterator[tuple[str, str]]:
    for name, pair in cell.gantries.items() if cell is not None else ():
        yield name, f"pair of {' and '.join(pair.axes)}"


def nodes_and_axes(cell: CellConfig | None) -> Iterator[tuple[str, str]]:
    """Yield the names of nodes, each with its description."""
    for node_id, node in cell.nodes.items() if cell is not None else ():
        yield str(node_id), node.file or ""
    yield from _axes(cell, driven=True)


def _axes(cell: CellConfig | None, *, driven: bool = False) -> Iterator[tuple[str, str]]:
    for name, axis in cell.axes.items() if cell is not None else ():
        if not axis.virtual:
            yield name, f"axis of node {axis.node}"
        elif not driven:
            yield name, "virtual axis"


def _range(limits: tuple[float, float] | None, unit: str) -> str:
    return unit if limits is None else f"{limits[0]:g} to {limits[1]:g} {unit}"


def _fitting(incomplete: str, found: Iterator[tuple[str, str]] | list[tuple[str, str]]) -> Items:
    return [CompletionItem(name, help=text or None) for name, text in found if name.startswith(incomplete)]
