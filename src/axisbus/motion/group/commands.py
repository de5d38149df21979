"""The commands of a group, as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.motion import commands as c
from axisbus.motion.blending.mode import BufferMode
from axisbus.motion.coupling.definition import Entry, Law, MasterValue
from axisbus.motion.gantry.commands import GantryCommand
from axisbus.motion.group.path import Path
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints


@dataclass(frozen=True, slots=True)
class ForEach:
    """One axis command for each axis of the group. ``together``: all axes start in one cycle, when all are prepared."""

    commands: Mapping[str, c.Command]
    together: bool = False

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the command."""
        return tuple(self.commands)


@dataclass(frozen=True, slots=True)
class MoveLinear:
    """MC_MoveLinearAbsolute: a straight line to ``ends`` (units), with path velocity and acceleration (units/s, units/s²).

    ``jerk`` in units/s³; None: not limited. ``buffer``: begin when the group's active commands have ended as done.
    """

    ends: Mapping[str, float]
    velocity: float
    acceleration: float
    jerk: float | None = None
    buffer: bool = False

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the command."""
        return tuple(self.ends)


@dataclass(frozen=True, slots=True)
class PathTransition:
    """How a path takes over from the active path without a stop: the corner stays within ``blend`` (units) of the transition.

    ``extends``: the points belong to the active path, and are rejected if it has ended.
    """

    mode: BufferMode
    blend: float
    extends: bool = False


@dataclass(frozen=True, slots=True)
class MovePath:
    """MC_MovePath, MC_MoveCircularAbsolute: along the path ``path``, which begins at the axes' position, with ``velocity``.

    ``window``: number of cycles to average over; more than one if the jerk is limited. ``buffer``: as in ``MoveLinear``. With
    ``takeover`` the path is appended to the active path.
    """

    axes: tuple[str, ...]
    path: Path
    velocity: float
    window: int = 1
    buffer: bool = False
    takeover: PathTransition | None = None


@dataclass(frozen=True, slots=True)
class GroupContinue:
    """MC_GroupContinue: resume the last line, path or stream of these axes from the position where it was interrupted.

    ``stream``: the number of a stream that gets more points; None: the axes go to the end of the known points.
    """

    axes: tuple[str, ...]
    stream: int | None = None


@dataclass(frozen=True, slots=True)
class GroupSetOverride:
    """MC_GroupSetOverride: lines and paths run at ``factor`` times their velocity, from 0 (hold) to 1.5."""

    factor: float

    @property
    def axes(self) -> tuple[str, ...]:
        """No axis: a stop does not change an override."""
        return ()


@dataclass(frozen=True, slots=True)
class CellSetOverride:
    """MC_SetOverride for all present and future axes: ``factor`` from 0 (hold) to 1.5, multiplied by the override of each axis."""

    factor: float

    @property
    def axes(self) -> tuple[str, ...]:
        """No axis: a stop does not change an override."""
        return ()


@dataclass(frozen=True, slots=True)
class Couple:
    """MC_GearIn, MC_GearInPos, MC_CamIn: ``slave`` follows ``master`` by ``law``, after it has been synchronised by ``entry``."""

    master: str
    slave: str
    law: Law
    entry: Entry
    master_value: MasterValue = MasterValue.COMMAND

    @property
    def axes(self) -> tuple[str, ...]:
        """The slave: the command does not change the motion of the master."""
        return (self.slave,)


@dataclass(frozen=True, slots=True)
class ProbeMove:
    """``axis`` executes the absolute move ``move``; it is halted when the one-edge ``probe`` has latched an edge."""

    axis: str
    move: c.Move
    probe: c.Probe

    @property
    def axes(self) -> tuple[str, ...]:
        """The axis of the command."""
        return (self.axis,)


GroupCommand = (
    ForEach
    | MoveLinear
    | MovePath
    | GroupContinue
    | GroupSetOverride
    | CellSetOverride
    | Couple
    | FollowPoints
    | AddPoints
    | ProbeMove
    | GantryCommand
)
