"""The override of an axis: the factor for the velocities of its commands.

Theory of operation
-------------------
An axis has its own factor, which is multiplied by the factor of the cell. The product is at most ``MAX_OVERRIDE``, and the scaled
velocity is at most ``max_velocity``. Only commanded velocities are scaled: no ramp, torque, halt, stop or homing.
"""

from __future__ import annotations

from axisbus.errors import LimitError
from axisbus.motion.parameters import AxisParameters
from axisbus.units import INT32_HALF

MAX_OVERRIDE = 1.5  # the highest override


class Override:
    """Holds the factor of one axis and the factor of its cell; ``factor`` is the resulting override."""

    __slots__ = ("cell", "factor", "own")

    def __init__(self) -> None:
        self.own = self.cell = self.factor = 1.0

    def set_own(self, own: float) -> None:
        """Set the factor of the axis (0 to 1.5)."""
        self.own = own
        self.factor = min(own * self.cell, MAX_OVERRIDE)

    def set_cell(self, cell: float) -> None:
        """Set the factor of the cell (0 to 1.5)."""
        self.cell = cell
        self.factor = min(self.own * cell, MAX_OVERRIDE)


def require_factor(factor: float, name: str) -> None:
    """Raise LimitError if ``factor`` is not from 0 to 1.5; ``name`` is the name of the command."""
    if not 0.0 <= factor <= MAX_OVERRIDE:
        raise LimitError(f"{name}: an override must be from 0 to {MAX_OVERRIDE:g}")


def scaled(velocity: int, factor: float, parameters: AxisParameters) -> int:
    """Return a velocity (signed, increments of the drive) under an override, within ``max_velocity`` and the range of the object.

    With a factor above 0 it does not become 0.
    """
    if factor == 1.0 or not velocity:
        return velocity
    size = min(abs(velocity) * factor, float(INT32_HALF - 1), _limit_increments(velocity, parameters))
    raw = max(1, int(size)) if factor else 0
    return raw if velocity > 0 else -raw


def _limit_increments(velocity: int, parameters: AxisParameters) -> float:
    """Return the limit in increments; the commanded velocity was within it, however it was rounded."""
    limit, scale = parameters.limits.velocity, parameters.units.velocity
    return float(INT32_HALF) if limit is None else max(limit * abs(scale.factor), abs(velocity))


def deadline_extension(factor: float, period: float) -> float:
    """Return by how much a deadline moves in a cycle of ``period`` seconds: its time runs as slowly as the motion."""
    return period * (1.0 - min(factor, 1.0))
