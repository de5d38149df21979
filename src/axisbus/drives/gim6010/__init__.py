"""The GIM6010-8, a joint module whose factory protocol is CAN Simple. The names below are loaded when they are first used."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from axisbus.drives.gim6010.can_simple.mit import MitCommand, MitFeedback, MitRanges
    from axisbus.drives.gim6010.mit import MitControl, read_mit_ranges
    from axisbus.drives.gim6010.mit_control import MitCycle, MitSettings

_HOME = {
    "MitCommand": "can_simple.mit",
    "MitControl": "mit",
    "MitCycle": "mit_control",
    "MitFeedback": "can_simple.mit",
    "MitRanges": "can_simple.mit",
    "MitSettings": "mit_control",
    "read_mit_ranges": "mit",
}

__all__ = [
    "MitCommand",
    "MitControl",
    "MitCycle",
    "MitFeedback",
    "MitRanges",
    "MitSettings",
    "read_mit_ranges",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
