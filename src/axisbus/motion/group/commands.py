"""What a user can ask of a group, as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.motion import commands as c
from axisbus.motion.blending.mode import BufferMode
from axisbus.motion.coupling.gear_and_cam import Law
from axisbus.motion.coupling.sync_options import By, Entry
from axisbus.motion.gantry.commands import GantryCommand
from axisbus.motion.group.path import Path
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints


@dataclass(frozen=True, slots=True)
class ForEach:
    """The same or own axis commands for every axis of the group; ``together``: all start in one cycle, once all are prepared."""

    commands: Mapping[str, c.Command]
    together: bool = False

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that it concerns."""
        return tuple(self.commands)


@dataclass(frozen=True, slots=True)
class MoveLinear:
    """MC_MoveLinearAbsolute: a straight line to ``ends`` (units), with path velocity and acceleration (units/s, units/s²).

    ``jerk`` in units/s³; None: it is not limited. ``buffer``: it begins when what the group does has ended well.
    """

    ends: Mapping[str, float]
    velocity: float
    acceleration: float
    jerk: float | None = None
    buffer: bool = False

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that it concerns."""
        return tuple(self.ends)


@dataclass(frozen=True, slots=True)
class PathTransition:
    """How a path takes over from the one that is under way, without a stop: the corner stays within ``blend`` (units) of the joint.

    ``extends``: its points belong to that path, and are refused when it has ended.
    """

    mode: BufferMode
    blend: float
    extends: bool = False


@dataclass(frozen=True, slots=True)
class MovePath:
    """MC_MovePath, MC_MoveCircularAbsolute: along a ``way`` of these axes, which begins where they stand, with ``velocity``.

    ``window``: of how many cycles the mean is taken; more than one where its jerk is limited. ``buffer``: as ``MoveLinear``. With
    ``takeover`` it goes on with what is under way.
    """

    axes: tuple[str, ...]
    way: Path
    velocity: float
    window: int = 1
    buffer: bool = False
    takeover: PathTransition | None = None


@dataclass(frozen=True, slots=True)
class GroupContinue:
    """MC_GroupContinue: these axes go on along their last line, path or stream, from where it was left.

    ``stream``: the number of a stream to which points are added again; None: they go to the end of what is known.
    """

    axes: tuple[str, ...]
    stream: int | None = None


@dataclass(frozen=True, slots=True)
class GroupSetOverride:
    """MC_GroupSetOverride: lines and paths are gone along at ``factor`` times their velocity, from 0 (they hold) to 1.5."""

    factor: float

    @property
    def axes(self) -> tuple[str, ...]:
        """None that a stop could concern: it leaves an override as it is."""
        return ()


@dataclass(frozen=True, slots=True)
class CellSetOverride:
    """MC_SetOverride for all axes there are, and that come later: ``factor`` from 0 (they hold) to 1.5, times that of each axis."""

    factor: float

    @property
    def axes(self) -> tuple[str, ...]:
        """None that a stop could concern: it leaves an override as it is."""
        return ()


@dataclass(frozen=True, slots=True)
class Couple:
    """MC_GearIn, MC_GearInPos, MC_CamIn: ``slave`` goes where ``law`` has it for ``master``, once in step by ``entry``."""

    master: str
    slave: str
    law: Law
    entry: Entry
    by: By = By.COMMAND

    @property
    def axes(self) -> tuple[str, ...]:
        """The axis that it concerns: its master goes on as it does."""
        return (self.slave,)


@dataclass(frozen=True, slots=True)
class ProbeMove:
    """``axis`` makes ``move`` (an absolute one) until ``probe`` (of one edge) has seen an edge, and is halted then."""

    axis: str
    move: c.Move
    probe: c.Probe

    @property
    def axes(self) -> tuple[str, ...]:
        """The axis that it concerns."""
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
