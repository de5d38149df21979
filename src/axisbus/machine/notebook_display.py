"""The display of machines, axes and commands in a notebook: values of the last cycle in units; no request to a drive."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from axisbus.errors import StaleError
from axisbus.markup import guarded, table
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.machine.axis import Axis
    from axisbus.machine.handle import Handle
    from axisbus.machine.machine import Machine

UNKNOWN = "unknown"
_HEADS = ("axis", "state", "position", "velocity", "torque", "homed")


def machine_html(machine: Machine) -> str:
    """Return a machine as HTML: a row for each axis, and below it the errors of axes in ErrorStop."""
    return guarded("Machine", lambda: _machine(machine))


def axis_html(axis: Axis) -> str:
    """Return an axis as HTML."""
    return guarded(f"Axis {axis.name}", lambda: table(f"Axis {axis.name}", _axis(axis)))


def handle_html(handle: Handle) -> str:
    """Return a command as HTML."""
    return guarded("Handle", lambda: table(f"Command {handle.name}", _handle(handle)))


def _machine(machine: Machine) -> str:
    session = machine.session
    rows = [(axis.name, *_short(axis)) for axis in machine]
    notes = [f"{axis.name}: {axis.error}" for axis in machine if axis.error is not None]
    silent = session.silent
    if silent is not None:
        notes.insert(0, f"Its values are unknown because {silent}.")
    title = f"Machine {Path(machine.cell.file).name}: {counted(len(rows), 'axis', 'axes')}, {machine.real_time_status}"
    return table(title, rows, _HEADS, "\n".join(notes))


def _short(axis: Axis) -> Iterator[str]:
    yield _known(lambda: axis.state.value)
    yield _known(lambda: _number(axis.position, axis.unit))
    yield _known(lambda: _number(axis.velocity, f"{axis.unit}/s"))
    yield _known(lambda: _torque(axis))
    yield _known(lambda: _yes(axis.homed))


def _axis(axis: Axis) -> Iterator[tuple[str, str]]:
    state, position, velocity, torque, homed = _short(axis)
    yield "state", state
    if axis.error is not None:
        yield "error", str(axis.error)
    yield "power", _known(lambda: "on" if axis.enabled else "off")
    yield "position", position
    yield "target", _optional(axis.target, axis.unit)
    yield "distance to go", _optional(axis.distance_to_go, axis.unit)
    yield "velocity", velocity
    yield "torque", torque
    yield "following error", _known(lambda: _number(axis.following_error, axis.unit))
    yield "homed", homed


def _handle(handle: Handle) -> Iterator[tuple[str, str]]:
    yield "status", handle.status.value
    if handle.note:
        yield "note", handle.note
    if handle.error is not None:
        yield "error", str(handle.error)


def _known(read: Callable[[], str]) -> str:
    """Return a value that may be unknown."""
    try:
        return read()
    except StaleError:
        return UNKNOWN


def _number(value: float, unit: str) -> str:
    return f"{value:.6g} {unit}"


def _torque(axis: Axis) -> str:
    has_unit = axis._parameters.units.rated_torque is not None
    return f"{axis.torque:.4g} {'N·m' if has_unit else 'of rated torque'}"


def _optional(value: float | None, unit: str) -> str:
    return "none" if value is None else _number(value, unit)


def _yes(value: bool) -> str:
    return "yes" if value else "no"
