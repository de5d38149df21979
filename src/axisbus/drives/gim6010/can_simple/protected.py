"""Parameters and functions that are touched only when they are named one by one: calibration, what belongs to one module, acts."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase

from axisbus.cia301.tables import rows


@dataclass(frozen=True, slots=True)
class Protected:
    """A row of the table: a path in which * stands for any characters, its ``kind`` (calibration, unit, link, act), and why."""

    path: str
    kind: str
    why: str


TABLE = tuple(Protected(row["path"], row["kind"], row["why"]) for row in rows(__package__, "protected.tsv"))


def protected(path: str) -> Protected | None:
    """Return why a path (without ``odrv0.``) is protected; None where it is not."""
    return next((each for each in TABLE if fnmatchcase(path, each.path)), None)
