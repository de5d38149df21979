"""Size of one increment of a drive's positions, velocities and accelerations, by its SI unit objects (60A8h, 60A9h, 60AAh).

Bits 31 to 24 are a power of ten, 23 to 16 the unit, 15 to 8 the time unit (codes of CiA 303-2). Older drives have a notation index
(the power of ten) and a dimension index instead; of the latter only the code of revolutions per minute is supported.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from axisbus.units import TURNS

INCREMENT, TURN = "inc", "rev"
WHAT = {
    0x01: "m",
    0x10: "rad",
    0x40: "gon",
    0x41: "deg",
    0x42: "arcmin",
    0x43: "arcsec",
    0xB4: TURN,
    0xB5: INCREMENT,
}
PER = {0x00: "", 0x03: "/s", 0x47: "/min", 0x48: "/h", 0x57: "/s²"}
_SECONDS = {0x00: 1, 0x03: 1, 0x47: 60, 0x48: 3600, 0x57: 1}
_RPM = 0xC0  # as the unit: revolutions per minute, for accelerations in rpm/s
_DIMENSION_RPM = 0xA4
_GON = Fraction(1, 400)


class IncrementSize(NamedTuple):
    """Size of one increment in ``what`` (increments of the position, turns, or metres), per second or second² if it has a time.

    ``text`` is the unit as text.
    """

    what: str
    size: Fraction
    text: str


def decoded(code: int | None) -> IncrementSize | None:
    """Return the meaning of an SI unit object; None if it is missing, 0, or not one of the usual units."""
    if not code:
        return None
    power, what, per = int.from_bytes((code >> 24 & 0xFF,), signed=True), code >> 16 & 0xFF, code >> 8 & 0xFF
    rpm = what == _RPM
    if (what not in WHAT and not rpm) or per not in PER:
        return None
    name = "rev/min" if rpm else WHAT[what]
    size = Fraction(10) ** power / _SECONDS[per] / (60 if rpm else 1)
    kind, turns = (TURN, Fraction(1)) if rpm else _kind(name)
    return IncrementSize(kind, size * turns, f"{f'{10.0**power:g}' if power else ''}{name}{PER[per]}")


def by_dimension(notation: int | None, dimension: int | None) -> IncrementSize | None:
    """Return the meaning of a notation index and a dimension index (608Bh, 608Ch); None if it is not known."""
    if dimension != _DIMENSION_RPM:
        return None
    power = (notation or 0) - (0x100 if (notation or 0) > 0x7F else 0)
    return IncrementSize(TURN, Fraction(10) ** power / 60, f"{f'{10.0**power:g}' if power else ''}rev/min")


def _kind(name: str) -> tuple[str, Fraction]:
    if name == "gon":
        return TURN, _GON
    if name in TURNS:
        return TURN, TURNS[name]
    return name, Fraction(1)
