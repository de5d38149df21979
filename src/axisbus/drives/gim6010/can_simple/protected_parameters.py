"""Parameters and functions accessed only if named one by one: calibration, data of one module, communication, actions."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase

from axisbus.cia301.tables import rows


@dataclass(frozen=True, slots=True)
class Protected:
    """A row of the table: a path in which * matches any characters, its ``kind`` (calibration, unit, link, act), and the reason."""

    path: str
    kind: str
    why: str


TABLE = tuple(Protected(row["path"], row["kind"], row["why"]) for row in rows(__package__, "protected.tsv"))


def protected(path: str) -> Protected | None:
    """Return the row that protects a path (without ``odrv0.``); None if it is not protected."""
    return next((each for each in TABLE if fnmatchcase(path, each.path)), None)
