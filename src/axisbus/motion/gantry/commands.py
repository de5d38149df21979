"""The commands of a gantry pair in addition to those of any group, as frozen values; positions in the axes' unit."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.motion.commands import TargetReference


@dataclass(frozen=True, slots=True)
class GantryEnable:
    """MC_Power of both axes in one SYNC; ``skew``: enable with this wider bound of the skew monitor, None: with ``max_skew``."""

    axes: tuple[str, str]
    skew: float | None = None


@dataclass(frozen=True, slots=True)
class GantryMove:
    """MC_MoveAbsolute, MC_MoveRelative, MC_MoveAdditive of the beam to, or by, ``value``; velocity etc. apply to the beam.

    ``buffer``: begin when the pair's active commands have ended as done.
    """

    axes: tuple[str, str]
    reference: TargetReference
    value: float
    velocity: float
    acceleration: float
    jerk: float | None = None
    buffer: bool = False


@dataclass(frozen=True, slots=True)
class GantryVelocity:
    """MC_MoveVelocity of the beam; ``velocity`` is signed and not 0."""

    axes: tuple[str, str]
    velocity: float
    acceleration: float


@dataclass(frozen=True, slots=True)
class GantryHome:
    """Home both axes by their switches, with ``acceleration``; ``key`` distinguishes these touch-probe requests from others."""

    axes: tuple[str, str]
    acceleration: float
    key: int


@dataclass(frozen=True, slots=True)
class GantrySquare:
    """Move ``axis`` alone, while the other one holds: by ``distance``; None: until the beam is square."""

    axes: tuple[str, str]
    axis: str
    distance: float | None
    velocity: float
    acceleration: float


@dataclass(frozen=True, slots=True)
class GantrySetPosition:
    """MC_SetPosition: the beam, at rest, is at ``position``; with ``square``, its present skew counts as square."""

    axes: tuple[str, str]
    position: float
    square: bool


GantryCommand = GantryEnable | GantryMove | GantryVelocity | GantryHome | GantrySquare | GantrySetPosition
