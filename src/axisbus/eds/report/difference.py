"""One difference between two EDS files, as a value."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class DifferenceGroup(Enum):
    """The subject of a difference, the most important first."""

    IDENTITY = "identity"
    PDO = "PDOs"
    REMOVED = "removed"
    TYPES = "types and access"
    LIMITS = "limits"
    DEFAULTS = "defaults"
    NAMES = "names"
    ADDED = "added"


@dataclass(frozen=True, slots=True)
class EdsDifference:
    """One difference between file A and file B.

    ``what`` names it, ``a`` and ``b`` are the two sides as texts (empty: absent), ``matters`` is the consequence for a master
    (empty: probably none). ``line_a`` and ``line_b`` count from 1, 0 if there is no line.
    """

    group: DifferenceGroup
    what: str
    a: str
    b: str
    index: int | None = None
    subindex: int | None = None
    matters: str = ""
    line_a: int = 0
    line_b: int = 0
