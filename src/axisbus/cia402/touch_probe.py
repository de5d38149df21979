"""The touch probe of CiA 402-2: the bits of its function (60B8h) and status (60B9h), and the objects of its latched positions.

The bits below are those of touch probe 1; those of touch probe 2 are eight bits higher. Bits 6 and 7 are manufacturer-specific in
both objects: they are not changed and not evaluated.
"""

from __future__ import annotations

from enum import Enum

INPUTS = (1, 2)


class Edge(Enum):
    """The edge of the signal at which the position is latched."""

    RISING = "rising"
    FALLING = "falling"


class ProbeSource(Enum):
    """Source of the signal: the touch probe's own input, or the zero pulse of the encoder."""

    INPUT = "input"
    ZERO_PULSE = "zero pulse"


# 60B8h: function of the touch probe.
ENABLE = 0x01
CONTINUOUS = 0x02  # 0: the first edge only
SOURCE = {ProbeSource.INPUT: 0x00, ProbeSource.ZERO_PULSE: 0x04}
SAMPLE = {Edge.RISING: 0x10, Edge.FALLING: 0x20}
# 60B9h: status of the touch probe.
ENABLED = 0x01
STORED = {Edge.RISING: 0x02, Edge.FALLING: 0x04}
IN_USE = ENABLED | STORED[Edge.RISING] | STORED[Edge.FALLING]

MAKERS_OWN = 0xC0  # of each byte

# Objects of the latched position, and of the number of latched edges (modulo 10000h), by input and edge.
POSITIONS = {
    (1, Edge.RISING): 0x60BA,
    (1, Edge.FALLING): 0x60BB,
    (2, Edge.RISING): 0x60BC,
    (2, Edge.FALLING): 0x60BD,
}
COUNTERS = {
    (1, Edge.RISING): 0x60D5,
    (1, Edge.FALLING): 0x60D6,
    (2, Edge.RISING): 0x60D7,
    (2, Edge.FALLING): 0x60D8,
}


def byte_of(word: int, number: int) -> int:
    """Return the bits of touch probe ``number`` (1 or 2) in a function or a status."""
    return word >> 8 * (number - 1) & 0xFF


def with_byte(word: int, number: int, bits: int) -> int:
    """Return a function with ``bits`` for touch probe ``number``.

    Its manufacturer-specific bits and the other probe are unchanged.
    """
    shift = 8 * (number - 1)
    own = byte_of(word, number) & MAKERS_OWN
    return word & ~(0xFF << shift) & 0xFFFF | (own | bits) << shift


def function_bits(edges: frozenset[Edge], source: ProbeSource, *, continuous: bool) -> int:
    """Return the bits that arm a touch probe."""
    bits = ENABLE | SOURCE[source] | (CONTINUOUS if continuous else 0)
    return bits | sum(SAMPLE[edge] for edge in edges)
