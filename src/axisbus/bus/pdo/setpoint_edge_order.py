"""Can a drive see the edge of a new set-point (6040h bit 4) before the target that belongs to it?

Theory of operation
-------------------
CiA 301 does not define the order in which a drive processes the entries of an RPDO, and several RPDOs, that came with one SYNC.
Many stacks write them into the dictionary one by one. They take the set-point at the moment at which bit 4 rises, with the target
that is present then. Only one order is safe: target and controlword in the same RPDO, the target first, and no other RPDO with a
controlword that could bring the edge earlier. In any other order the target goes with one SYNC (or frame), and the edge with the
next.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

CONTROLWORD = "controlword"
_TARGET = "target_position"


def delay(after_target: bool, foreign_sync: bool) -> int:
    """Return the number of cycles from the target to its edge.

    There is a SYNC of the master between any two cycles. With the SYNC of another device there may be none: a cycle that took too
    long sends its frames with those of the next. Then only the second cycle is sure to have a SYNC in between.
    """
    return int(after_target) + int(after_target and foreign_sync)


def after_target(rpdos: Iterable[Sequence[str | None]]) -> bool:
    """Whether the edge must wait for the target's SYNC; ``rpdos``: the values of each RPDO in use, in the order of mapping.

    A target that is written by SDO needs no such wait: the port holds the controlword back until the drive has confirmed the
    target.
    """
    mappings = list(rpdos)
    if not any(_TARGET in values for values in mappings):
        return False
    words = [values for values in mappings if CONTROLWORD in values]
    if len(words) != 1 or _TARGET not in words[0]:
        return True
    return words[0].index(CONTROLWORD) < words[0].index(_TARGET)
