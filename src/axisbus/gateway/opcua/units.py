"""The units of an axis for OPC UA: UNECE's common codes (Recommendation 20), and the numbers derived from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

NAMESPACE = "http://www.opcfoundation.org/UA/units/un/cefact"
_UNKNOWN = -1  # OPC 10000-8 5.6.4.3: a unit without a number


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: its common code ("" if no UNECE code is known), its symbol, and its name."""

    code: str
    symbol: str
    name: str

    @property
    def number(self) -> int:
        """The unitId of OPC 10000-8 5.6.4.3: the characters of the code, eight bits each; -1 without a code."""
        return int.from_bytes(self.code.encode("ascii"), "big") if self.code else _UNKNOWN


_DEGREE = ("DD", "degree"), ("E96", "degree per second")
_TURN = ("M44", "revolution"), ("RPS", "revolutions per second")
_MICRO = ("4H", "micrometre"), ("", "micrometre per second")
_INCH = ("INH", "inch"), ("IU", "inch per second")
# By the word of the cell file: code and name of the unit, and of the unit per second.
_POSITIONS: Mapping[str, tuple[tuple[str, str], tuple[str, str]]] = {
    "deg": _DEGREE,
    "degree": _DEGREE,
    "degrees": _DEGREE,
    "°": _DEGREE,
    "arcmin": (("D61", "minute of angle"), ("", "minute of angle per second")),
    "arcsec": (("D62", "second of angle"), ("", "second of angle per second")),
    "rad": (("C81", "radian"), ("2A", "radian per second")),
    "mrad": (("C25", "milliradian"), ("", "milliradian per second")),
    "rev": _TURN,
    "turn": _TURN,
    "turns": _TURN,
    "m": (("MTR", "metre"), ("MTS", "metre per second")),
    "dm": (("DMT", "decimetre"), ("", "decimetre per second")),
    "cm": (("CMT", "centimetre"), ("2M", "centimetre per second")),
    "mm": (("MMT", "millimetre"), ("C16", "millimetre per second")),
    "um": _MICRO,
    "\u00b5m": _MICRO,
    "\u03bcm": _MICRO,
    "nm": (("C45", "nanometre"), ("", "nanometre per second")),
    "in": _INCH,
    "inch": _INCH,
    "mil": (("77", "milli-inch"), ("", "milli-inch per second")),
    "ft": (("FOT", "foot"), ("FS", "foot per second")),
    "%": (("P1", "percent"), ("", "percent per second")),
    "l": (("LTR", "litre"), ("", "litre per second")),
    "ml": (("MLT", "millilitre"), ("", "millilitre per second")),
}
CELSIUS = Unit("CEL", "°C", "degree Celsius")
TORQUE = Unit("NU", "N·m", "newton metre")
PART_OF_RATED = Unit("C62", "", "part of the rated torque")


def position_unit(unit: str) -> Unit:
    """Return the unit of positions for the ``unit`` of a cell file; a unit without UNECE code keeps its name."""
    found = _POSITIONS.get(unit)
    return Unit("", unit, unit) if found is None else Unit(found[0][0], unit, found[0][1])


def velocity_unit(unit: str) -> Unit:
    """Return the unit of its velocities."""
    found, symbol = _POSITIONS.get(unit), f"{unit}/s"
    return Unit("", symbol, f"{unit} per second") if found is None else Unit(found[1][0], symbol, found[1][1])


def torque_unit(rated_torque: float | None) -> Unit:
    """Return the unit of torques: N·m if the cell file has the rated torque, else fractions of it."""
    return PART_OF_RATED if rated_torque is None else TORQUE
