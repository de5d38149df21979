"""Options of a coupling as frozen values: the master's value to follow, and how the slave synchronises with its master."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class By(Enum):
    """The value of the master to follow: its commanded position or its actual position."""

    COMMAND = "command"
    ACTUAL = "actual"


@dataclass(frozen=True, slots=True)
class SyncAtSpeed:
    """MC_GearIn: the slave accelerates to the required speed with ``acceleration`` (unit/s²), and is then synchronised."""

    acceleration: float


@dataclass(frozen=True, slots=True)
class AtPlace:
    """MC_GearInPos: slave at ``slave`` when master at ``master``; ``over``: master distance (units) for the synchronisation."""

    master: float
    slave: float
    over: float


@dataclass(frozen=True, slots=True)
class SyncInPlace:
    """MC_CamIn: synchronise from the present positions within ``over`` units of the master (0: the slave must be at its set-point).

    ``relative``: the slave's present position counts as its set-point.
    """

    over: float = 0.0
    relative: bool = False


Entry = SyncAtSpeed | AtPlace | SyncInPlace
