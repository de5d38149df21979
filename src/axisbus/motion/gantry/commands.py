"""What a user can ask of a gantry pair beside what any group does, as frozen values; places in the axes' unit."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.motion.commands import TargetReference


@dataclass(frozen=True, slots=True)
class GantryEnable:
    """MC_Power of both in one SYNC; ``skew``: with the watch at this wider bound, None: at ``max_skew``."""

    axes: tuple[str, str]
    skew: float | None = None


@dataclass(frozen=True, slots=True)
class GantryMove:
    """MC_MoveAbsolute, MC_MoveRelative, MC_MoveAdditive of the beam to, or by, ``value``; velocity and so on are its own.

    ``buffer``: it begins when what the pair does has ended well.
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
    """MC_MoveVelocity of the beam, ``velocity`` signed and not 0."""

    axes: tuple[str, str]
    velocity: float
    acceleration: float


@dataclass(frozen=True, slots=True)
class GantryHome:
    """Find the switches of both, going with ``acceleration``; ``key`` tells the requests to the touch probes from others."""

    axes: tuple[str, str]
    acceleration: float
    key: int


@dataclass(frozen=True, slots=True)
class GantrySquare:
    """Move ``axis`` alone, while the other holds: by ``distance``, None: until the beam is square."""

    axes: tuple[str, str]
    axis: str
    distance: float | None
    velocity: float
    acceleration: float


@dataclass(frozen=True, slots=True)
class GantrySetPosition:
    """MC_SetPosition: the beam, at rest, is at ``position``; with ``square`` it is taken to be square as it stands."""

    axes: tuple[str, str]
    position: float
    square: bool


GantryCommand = GantryEnable | GantryMove | GantryVelocity | GantryHome | GantrySquare | GantrySetPosition
