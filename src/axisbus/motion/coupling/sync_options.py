"""By what a slave goes, and how it comes into step with its master, as frozen values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class By(Enum):
    """What a slave goes by: where its master is led to, or where it really is."""

    COMMAND = "command"
    ACTUAL = "actual"


@dataclass(frozen=True, slots=True)
class SyncAtSpeed:
    """MC_GearIn: the slave takes up its speed with ``acceleration`` (unit/s²), and is in step from where it has it."""

    acceleration: float


@dataclass(frozen=True, slots=True)
class AtPlace:
    """MC_GearInPos: the slave is at ``slave`` when the master is at ``master``; the master's ``over`` units before are for that."""

    master: float
    slave: float
    over: float


@dataclass(frozen=True, slots=True)
class SyncInPlace:
    """MC_CamIn: from where both are, within the next ``over`` units of the master (0: the slave stands where it is due).

    ``relative``: the place where the slave is counts as that where it is due.
    """

    over: float = 0.0
    relative: bool = False


Entry = SyncAtSpeed | AtPlace | SyncInPlace
