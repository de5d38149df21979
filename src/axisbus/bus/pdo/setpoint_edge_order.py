"""Whether a drive may see the edge of a new set-point (6040h bit 4) before the target that belongs to it.

Theory of operation
-------------------
CiA 301 does not say in which order a drive takes what came with one SYNC: the entries of an RPDO, and several RPDOs. Many stacks
write them into the dictionary one by one, and take the set-point at the moment when bit 4 rises, with the target that is there.
One order alone is safe by itself: target and controlword in the same RPDO, the target in front, and no other RPDO with a
controlword that could bring the edge earlier. In any other the target goes with one SYNC (or frame), the edge with the next.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

CONTROLWORD = "controlword"
_TARGET = "target_position"


def delay(after_target: bool, foreign_sync: bool) -> int:
    """Return how many cycles the edge comes after its target.

    Our own SYNC stands between any two cycles. Another device's does not: a cycle that took too long sends its frames with those
    of the next, so that only the second cycle is sure to have a SYNC between.
    """
    return int(after_target) + int(after_target and foreign_sync)


def after_target(rpdos: Iterable[Sequence[str | None]]) -> bool:
    """Whether the edge must wait for the target's SYNC; ``rpdos``: the values that each RPDO in use carries, as they are mapped.

    A target that travels by SDO needs no such wait: the port keeps the controlword back until the drive has confirmed it.
    """
    mappings = list(rpdos)
    if not any(_TARGET in values for values in mappings):
        return False
    words = [values for values in mappings if CONTROLWORD in values]
    if len(words) != 1 or _TARGET not in words[0]:
        return True
    return words[0].index(CONTROLWORD) < words[0].index(_TARGET)
