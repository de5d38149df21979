"""Axes on the command line: named directly, by a group or by a pair, each at most once."""

from __future__ import annotations

from collections.abc import Iterable

import click

from axisbus.cell.model import CellConfig
from axisbus.errors import StateError


def chosen(cell: CellConfig, names: Iterable[str]) -> list[str]:
    """Return the named axes, with all axes of a named group or pair; all axes of the cell if none is named.

    Raises:
        UsageError: one is named twice.
        StateError: the cell has no such axis, group or pair, or no axis at all.
    """
    found = [axis for name in names for axis in _named(cell, name)]
    once(found)
    if not found and not cell.axes:
        raise StateError("the cell has no axis", remedy="add [axes.x] with node, unit and scale to cell.toml")
    return found or list(cell.axes)


def driven(cell: CellConfig, names: Iterable[str]) -> list[str]:
    """As ``chosen``, but without virtual axes, which have no drive, unless they are named directly.

    Raises:
        UsageError, StateError: as ``chosen``; StateError also if none is left.
    """
    names = list(names)
    found = chosen(cell, names)
    remaining = [name for name in found if name in cell.driven or name in names]
    if not remaining:
        raise cell.axes[found[0]].no_drive("no drive")
    return remaining


def once(names: Iterable[str]) -> None:
    """Check that no axis is named twice.

    Raises:
        UsageError: one is.
    """
    names = list(names)
    twice = next((name for number, name in enumerate(names) if name in names[:number]), None)
    if twice is not None:
        raise click.UsageError(f"axis {twice} is named twice; nothing was sent: name it once")


def _named(cell: CellConfig, name: str) -> tuple[str, ...]:
    if name in cell.axes:
        return (name,)
    if name in cell.groups:
        return cell.groups[name].axes
    if name in cell.gantries:
        return cell.gantries[name].axes
    raise cell.no_axis(name, groups=True, pairs=True)


def of_node(cell: CellConfig, node: int | None) -> str:
    """Return the axes of a node, for people; the node itself if it has none, empty for the bus (None)."""
    return "" if node is None else " ".join(axis.name for axis in cell.axes_of(node)) or f"node {node}"
