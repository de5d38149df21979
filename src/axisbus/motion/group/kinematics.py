"""Kinematics: conversion between axis positions and workspace positions, for CoreXY, SCARA and delta robots.

Lengths are in one unit, angles in degrees. Each class is a frozen value. ``forward`` converts axis positions to the workspace
position, ``inverse`` does the opposite and raises ValueError if the position is out of reach. Additional axes, such as a lift or a
tool, are passed through unchanged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from axisbus.motion.group.segments import Coordinates

_COS, _SIN = (
    (1.0, -0.5, -0.5),
    (0.0, math.sqrt(3.0) / 2.0, -math.sqrt(3.0) / 2.0),
)  # direction of the arms of a delta robot: 0, 120, 240 degrees


@dataclass(frozen=True, slots=True)
class CoreXY:
    """Two motors with one belt: a = x + y, b = x - y."""

    @property
    def characteristic_length(self) -> float:
        """Distance over which the ratios of axis speed to path speed vary: infinite, because they are constant."""
        return math.inf

    def forward(self, axes: Coordinates) -> Coordinates:
        """Return the workspace position for axis positions."""
        a, b, *rest = axes
        return (0.5 * (a + b), 0.5 * (a - b), *rest)

    def inverse(self, place: Coordinates) -> Coordinates:
        """Return the axis positions for a workspace position."""
        x, y, *rest = place
        return (x + y, x - y, *rest)


@dataclass(frozen=True, slots=True)
class Scara:
    """Two arms in a plane: ``upper`` from the shoulder at (0, 0) to the elbow, ``fore`` from the elbow to the tool.

    The first axis turns the shoulder (0: along x), the second the elbow (0: stretched). ``left``: the elbow bends to positive
    angles. Shoulder positions are within half a turn of ``middle``.
    """

    upper: float
    fore: float
    left: bool = True
    middle: float = 0.0

    @property
    def characteristic_length(self) -> float:
        """The reach of the arms."""
        return self.upper + self.fore

    def forward(self, axes: Coordinates) -> Coordinates:
        """Return the workspace position for axis positions."""
        shoulder, elbow, *rest = axes
        t, u = math.radians(shoulder), math.radians(shoulder + elbow)
        x = self.upper * math.cos(t) + self.fore * math.cos(u)
        y = self.upper * math.sin(t) + self.fore * math.sin(u)
        return (x, y, *rest)

    def inverse(self, place: Coordinates) -> Coordinates:
        """Return the axis positions for a workspace position.

        Raises:
            ValueError: the position is out of reach.
        """
        x, y, *rest = place
        cos = (x * x + y * y - self.upper**2 - self.fore**2) / (2.0 * self.upper * self.fore)
        if not -1.0 <= cos <= 1.0:
            raise ValueError(f"({x:g}, {y:g}) is out of the arm's reach")
        elbow = math.acos(cos) if self.left else -math.acos(cos)
        shoulder = math.degrees(
            math.atan2(y, x)
            - math.atan2(self.fore * math.sin(elbow), self.upper + self.fore * math.cos(elbow))
        )
        turned = self.middle + (shoulder - self.middle + 180.0) % 360.0 - 180.0
        return (turned, math.degrees(elbow), *rest)


@dataclass(frozen=True, slots=True)
class Delta:
    """Three arms around a base at (0, 0, 0) that hold a plate below it (negative z); three axes turn the upper arms.

    ``base`` and ``plate``: distance of the joints from the centre; ``upper`` and ``fore``: length of the arms. At 0 an upper arm is
    horizontal, and at positive angles it points down. The arms are at 0, 120 and 240 degrees from x.
    """

    base: float
    plate: float
    upper: float
    fore: float

    @property
    def characteristic_length(self) -> float:
        """The reach of the arms."""
        return self.upper + self.fore

    def forward(self, axes: Coordinates) -> Coordinates:
        """Return the workspace position for axis positions.

        Raises:
            ValueError: the arms do not meet, or their position is ambiguous.
        """
        knees = [self._knee(angle, n) for n, angle in enumerate(axes[:3])]
        return (*_below(knees, self.fore), *axes[3:])

    def inverse(self, place: Coordinates) -> Coordinates:
        """Return the axis positions for a workspace position.

        Raises:
            ValueError: the position is out of reach.
        """
        x, y, z, *rest = place
        return (*(self._angle(x, y, z, n) for n in range(3)), *rest)

    def _knee(self, angle: float, arm: int) -> tuple[float, float, float]:
        """Return the start of a forearm, shifted so that the plate's joint is at the plate's centre."""
        out = self.base - self.plate + self.upper * math.cos(math.radians(angle))
        return out * _COS[arm], out * _SIN[arm], -self.upper * math.sin(math.radians(angle))

    def _angle(self, x: float, y: float, z: float, arm: int) -> float:
        out = x * _COS[arm] + y * _SIN[arm] - (self.base - self.plate)  # in the plane of the arm
        across = y * _COS[arm] - x * _SIN[arm]
        fore = self.fore**2 - across**2  # squared, in the plane of the arm
        far = math.hypot(out, z)
        cos = (far**2 + self.upper**2 - fore) / (2.0 * far * self.upper) if far and fore >= 0.0 else 2.0
        if not -1.0 <= cos <= 1.0:
            raise ValueError(f"({x:g}, {y:g}, {z:g}) is out of the arms' reach")
        return math.degrees(math.atan2(-z, out) - math.acos(cos))


Kinematics = CoreXY | Scara | Delta


_SAME = 1e-9  # relative to the forearms' length: knees no farther apart count as one point


def _below(knees: list[tuple[float, float, float]], reach: float) -> tuple[float, float, float]:
    """Return the lower one of the two points at distance ``reach`` from three points."""
    first, second, third = knees
    u = [b - a for a, b in zip(first, second, strict=True)]
    d = math.hypot(*u)
    if d < _SAME * reach:
        raise ValueError("two arms end at one point")
    ex = [part / d for part in u]
    w = [b - a for a, b in zip(first, third, strict=True)]
    i = sum(a * b for a, b in zip(ex, w, strict=True))
    v = [b - i * a for a, b in zip(ex, w, strict=True)]
    j = math.hypot(*v)
    if j < _SAME * reach:
        raise ValueError("the arms end on one line")
    ey = [part / j for part in v]
    ez = [ex[1] * ey[2] - ex[2] * ey[1], ex[2] * ey[0] - ex[0] * ey[2], ex[0] * ey[1] - ex[1] * ey[0]]
    along, up = 0.5 * d, (i * i + j * j - i * d) / (2.0 * j)
    rest = reach**2 - along**2 - up**2
    if rest < 0.0:
        raise ValueError("the arms do not meet")
    side = -math.copysign(math.sqrt(rest), ez[2])
    x, y, z = (p + along * a + up * b + side * c for p, a, b, c in zip(first, ex, ey, ez, strict=True))
    return x, y, z
