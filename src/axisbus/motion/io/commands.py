"""The command for outputs, as a frozen value that can be pickled."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SetOutputs:
    """Set outputs by name, to raw values; outputs of one node in one frame if they are mapped into one."""

    values: tuple[tuple[str, int], ...]
