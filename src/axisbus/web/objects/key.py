"""The address of an object of a node, written as ``1:6064:00`` between page and server."""

from __future__ import annotations

import re
from dataclasses import dataclass

_SPELT = re.compile(r"([0-9]{1,3}):([0-9A-F]{4}):([0-9A-F]{2})", re.ASCII)


@dataclass(frozen=True, slots=True)
class ObjectKey:
    """One object of one node."""

    node: int
    index: int
    subindex: int

    def __str__(self) -> str:
        return f"{self.node}:{self.index:04X}:{self.subindex:02X}"


def read(text: object) -> ObjectKey | None:
    """Return the object that a text names; None if the text is invalid."""
    found = _SPELT.fullmatch(text) if isinstance(text, str) else None
    return None if found is None else ObjectKey(int(found[1]), int(found[2], 16), int(found[3], 16))
