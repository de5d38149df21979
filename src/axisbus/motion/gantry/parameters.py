"""What motion must know of a gantry pair, as frozen values in the axes' unit."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.cia402.touch_probe import Edge


@dataclass(frozen=True, slots=True)
class SwitchSearch:
    """How a pair finds where it is: both go ``distance`` (signed) at most, at ``velocity``, until their touch probes see ``edge``.

    ``positions``: what each axis's place is called at its own switch. ``skew``: how far the beam may be out of square when it is
    found. ``each``: both have a switch; else only the first, and the beam is taken to be square. ``input`` is 1 or 2.
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
    """Two axes that carry one beam: its place is that of the ``first``.

    The beam is square where the second is ``offset`` farther; ``max_skew`` (above 0) is how far from that it may be.
    """

    name: str
    first: str
    second: str
    max_skew: float
    offset: float = 0.0
    homing: SwitchSearch | None = None

    @property
    def axes(self) -> tuple[str, str]:
        """Both, the first one first."""
        return self.first, self.second
