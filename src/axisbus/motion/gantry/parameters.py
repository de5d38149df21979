"""Parameters of a gantry pair, as frozen values in the axes' unit."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.cia402.touch_probe import Edge


@dataclass(frozen=True, slots=True)
class SwitchSearch:
    """How a pair is homed: both axes move ``distance`` (signed) at most, at ``velocity``, until their touch probes see ``edge``.

    ``positions``: the position of each axis at its own switch. ``skew``: the permitted skew of the beam when homing finds it.
    ``each``: both axes have a switch; otherwise only the first has one, and the beam is assumed to be square. ``input`` is 1 or 2.
    """

    each: bool
    input: int
    edge: Edge
    velocity: float
    distance: float
    positions: tuple[float, float]
    skew: float


@dataclass(frozen=True, slots=True)
class GantryParameters:
    """Two axes that carry one beam, whose position is that of the ``first`` axis.

    The beam is square if the second axis is ``offset`` farther; ``max_skew`` (above 0) is the permitted deviation from that.
    """

    name: str
    first: str
    second: str
    max_skew: float
    offset: float = 0.0
    homing: SwitchSearch | None = None

    @property
    def axes(self) -> tuple[str, str]:
        """Both axes, the first one first."""
        return self.first, self.second
