"""Settings of ``[axes.NAME.feed_forward]``."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.cia402 import objects


@dataclass(frozen=True, slots=True)
class FeedForward:
    """``velocity``: send 60B1h in csp. ``inertia`` in N·m per unit/s² and ``torque`` (constant) in N·m: send 60B2h in csp and csv.

    ``turned``: the drive inverts velocities (607Eh bit 6) but not positions (bit 7), or vice versa, so that the velocity of a
    position has the opposite sign.
    """

    velocity: bool = False
    inertia: float | None = None
    torque: float | None = None
    turned: bool = False

    @property
    def by_torque(self) -> bool:
        """Whether 60B2h is sent at all."""
        return self.inertia is not None or self.torque is not None

    @property
    def outputs(self) -> tuple[str, ...]:
        """The names of the offsets that are sent (``cia402.port.OFFSET_OBJECTS``)."""
        return ("velocity_offset",) * self.velocity + ("torque_offset",) * self.by_torque

    @property
    def objects(self) -> frozenset[int]:
        """The objects that are sent."""
        found = [objects.VELOCITY_OFFSET] * self.velocity + [objects.TORQUE_OFFSET] * self.by_torque
        return frozenset(found)
