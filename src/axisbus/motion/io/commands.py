"""What a user can ask of outputs, as frozen values that can be pickled."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SetOutputs:
    """Set outputs by name, to raw values; those of one node in one frame where they are mapped into one."""

    values: tuple[tuple[str, int], ...]
