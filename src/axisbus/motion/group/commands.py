"""What a user can ask of a group, as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.motion import commands as c


@dataclass(frozen=True, slots=True)
class ForEach:
    """The same or own axis commands for every axis of the group; ``together``: all start in one cycle, once all are prepared."""

    commands: Mapping[str, c.Command]
    together: bool = False


@dataclass(frozen=True, slots=True)
class MoveLinear:
    """MC_MoveLinearAbsolute: a straight line to ``ends`` (units), with path velocity and acceleration (units/s, units/s²)."""

    ends: Mapping[str, float]
    velocity: float
    acceleration: float


GroupCommand = ForEach | MoveLinear
