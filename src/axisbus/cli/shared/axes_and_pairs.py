"""The axes and pairs that a command moves: an axis of a gantry pair is never moved without the other one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from axisbus.cell.model import CellConfig, GantryConfig
from axisbus.cli.shared.axes import once
from axisbus.errors import StateError
from axisbus.machine.axis import Axis
from axisbus.machine.dry_run import DryRun
from axisbus.machine.gantry import Gantry
from axisbus.machine.machine import Machine

Mover = Axis | Gantry


def as_pairs(cell: CellConfig, axes: Iterable[str], verb: str = "") -> list[str]:
    """Return ``axes`` with the name of a pair in place of its two axes.

    Raises:
        StateError: only one axis of a pair is named, and ``verb`` needs both ("": it does not).
    """
    names = list(dict.fromkeys(_pair_or_axis(cell, name, axes) for name in axes))
    for name in names if verb else ():
        require_gantry(cell, name, verb)
    return names


def _pair_or_axis(cell: CellConfig, axis: str, axes: Iterable[str]) -> str:
    pair = _pair_of(cell, axis)
    return pair.name if pair is not None and set(pair.axes) <= set(axes) else axis


def _pair_of(cell: CellConfig, axis: str) -> GantryConfig | None:
    return next((pair for pair in cell.gantries.values() if axis in pair.axes), None)


def require_gantry(cell: CellConfig, name: str, verb: str) -> None:
    """Check that ``name`` is not an axis of a pair.

    Raises:
        StateError: it is, and cannot be moved alone.
    """
    pair = _pair_of(cell, name)
    if pair is not None:
        raise StateError(
            f"{name}: {' and '.join(pair.axes)} carry one beam, and axisbus {verb} applies to both",
            observed=f"they are [gantries.{pair.name}] of cell.toml",
            remedy=f"name the pair: {pair.name}",
        )


def require_no_pair(cell: CellConfig, name: str, verb: str, remedy: str) -> None:
    """Check that ``name`` is neither a pair nor an axis of one.

    Raises:
        StateError: it is, and ``verb`` is not available for pairs; ``remedy``: what is.
    """
    pair = cell.gantries.get(name) or _pair_of(cell, name)
    if pair is not None:
        raise StateError(
            f"{name}: axisbus {verb} is for one axis, and {' and '.join(pair.axes)} carry one beam",
            observed=f"they are [gantries.{pair.name}] of cell.toml",
            remedy=remedy.replace("PAIR", pair.name),
        )


def sides_of(cell: CellConfig, names: Iterable[str], verb: str) -> list[str]:
    """Return the named axes, with both axes of a named pair.

    Raises:
        UsageError: one is named twice.
        StateError: there is no such axis or pair, or it is an axis of a pair.
    """
    found: list[str] = []
    for name in names:
        require_gantry(cell, name, verb)
        if name not in cell.axes and name not in cell.gantries:
            raise cell.no_axis(name, pairs=True)
        found += [name] if name in cell.axes else cell.gantries[name].axes
    once(found)
    return found


def movers(machine: Machine | DryRun, names: Iterable[str]) -> list[Mover]:
    """Return axes and pairs by their names."""
    return [machine.gantry(name) if name in machine.cell.gantries else machine[name] for name in names]


def has_drive(cell: CellConfig, name: str) -> bool:
    """Whether it is not a virtual axis, which has no drive and no homing."""
    return name in cell.driven or name in cell.gantries


def axes_of(mover: Mover) -> list[Axis]:
    """Return an axis, or both axes of a pair, first the one that defines the position of the beam."""
    return list(mover) if isinstance(mover, Gantry) else [mover]


def all_axes(of: Iterable[Mover]) -> Iterator[Axis]:
    """Yield the axes of several axes and pairs."""
    return (axis for mover in of for axis in axes_of(mover))
