"""The axes and groups of a machine by name. Axes of optional nodes may be added later."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from axisbus.cell.gantry import gantry_of
from axisbus.cell.group_kinematics import kinematics_of
from axisbus.cell.model import CellConfig
from axisbus.core.late_boot import absent_axis
from axisbus.errors import ArgumentError, StateError, UnknownNameError
from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.gantry import Gantry
from axisbus.machine.groups import Group
from axisbus.motion.numbers import short_repr
from axisbus.motion.parameters import AxisParameters

if TYPE_CHECKING:
    from axisbus.boot.report import Booted
    from axisbus.machine.node_access import NodeAccess


class AxisRegistry:
    """Holds the present axes, the groups that the cell names, and the groups that a program has asked for."""

    def __init__(
        self,
        cell: CellConfig,
        booted: Mapping[int, Booted],
        commanding: CommandDispatcher,
        node: Callable[[int], NodeAccess],
    ) -> None:
        """Begin with the axes of the core; ``node`` returns direct access by node-ID."""
        self._node = node
        self._groups: dict[str, Group] = {}  # of cell.toml
        self._chosen: dict[tuple[str, ...], Group] = {}  # by their axes
        self._cell = cell
        self._booted = booted
        self._commanding = commanding
        axes = commanding.session.axes
        self.axes = {name: self._make_axis(facts.parameters) for name, facts in axes.items()}
        self._gantries: dict[str, Gantry] = {}
        self._make_groups()

    def __getitem__(self, name: str) -> Axis:
        """Return an axis; raises StateError with the reason if it is absent."""
        if not isinstance(name, str):
            raise self._cell.no_axis(short_repr(name))
        if name in self.axes:
            return self.axes[name]
        if name in self._cell.axes:
            raise absent_axis(name, self._booted[self._cell.axes[name].node])
        raise self._cell.no_axis(name)

    def group(self, names: tuple[str, ...]) -> Group:
        """Return the group of this name in cell.toml, or a group of the named axes, in this order.

        Raises:
            StateError: there is no such group or axis.
            ArgumentError: an axis is named twice.
        """
        for name in names:
            if not isinstance(name, str):
                raise self._cell.no_axis(short_repr(name))
        if len(names) == 1 and names[0] in self._groups:
            return self._groups[names[0]]
        if not names:
            raise StateError(
                "a group needs a name or axes", observed=f"groups: {', '.join(self._groups) or 'none'}"
            )
        if len(names) == 1 and names[0] in self._cell.groups:
            names = tuple(self._cell.groups[names[0]].axes)  # an axis is absent: report which one
        for name in names:
            self[name]
        _require_different(names)
        if names not in self._chosen:
            self._commanding.session.add_group(names, names)
            axes = {axis: self.axes[axis] for axis in names}
            self._chosen[names] = Group("+".join(names), axes, self._commanding, key=names)
        return self._chosen[names]

    def join(self, booted: Booted) -> None:
        """Add the axes of a node that was booted while the machine runs, or let them use what was read now, after the core has."""
        late = {
            name: self._make_axis(parameters)
            for name, parameters in booted.parameters.items()
            if name not in self.axes
        }
        for name in booted.parameters.keys() - late.keys():
            self.axes[name]._renew(booted.parameters[name])
        self.axes = {**self.axes, **late}
        self._make_groups()

    @property
    def groups(self) -> Mapping[str, Group]:
        """The groups of the cell with all of their axes present, by name."""
        return dict(self._groups)

    def gantry(self, name: str) -> Gantry:
        """Return the gantry of this name; raises StateError if the cell has none, or if one of its axes is absent."""
        if isinstance(name, str) and name in self._gantries:
            return self._gantries[name]
        if not isinstance(name, str) or name not in self._cell.gantries:
            known = ", ".join(self._cell.gantries) or "none"
            raise UnknownNameError(f"the cell has no gantry {short_repr(name)}", observed=f"it has {known}")
        for axis in self._cell.gantries[name].axes:
            self[axis]
        pair = gantry_of(self._cell.gantries[name])
        first, second = (self.axes[axis] for axis in pair.axes)
        return self._gantries.setdefault(name, Gantry(pair, first, second, self._commanding))

    def _make_axis(self, parameters: AxisParameters) -> Axis:
        return Axis(parameters, self._commanding, self._measure)

    def _measure(self, name: str, what: str) -> float:
        axis = self._cell.axes[name]
        if axis.virtual:
            raise axis.no_drive(f"no {what}")
        return self._node(axis.node).measure(what, axis.drive_axis)

    def _make_groups(self) -> None:
        """Make the groups of the cell that have all of their axes."""
        for name, group in self._cell.groups.items():
            if name not in self._groups and all(axis in self.axes for axis in group.axes):
                axes = {axis: self.axes[axis] for axis in group.axes}
                made = kinematics_of(group.kinematics)
                self._groups[name] = Group(name, axes, self._commanding, kinematics=made)


def _require_different(names: tuple[str, ...]) -> None:
    twice = [name for number, name in enumerate(names) if name in names[:number]]
    if twice:
        raise ArgumentError(
            f"a group cannot hold {twice[0]} twice",
            observed=f"given were: {', '.join(names)}",
            remedy="name each axis once, in the order in which the group's positions are given",
        )
