"""EDS and DCF files: what they say, with line numbers.

What compares files is loaded when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from axisbus.eds.canopen_text import canopen_text
from axisbus.eds.model import Eds, Finding, Number, Object, ObjectType, Severity, Variable
from axisbus.eds.reader import load, loads

if TYPE_CHECKING:
    from axisbus.eds.compare import diff
    from axisbus.eds.difference import Difference

_HOME = {"Difference": "axisbus.eds.difference", "diff": "axisbus.eds.compare"}

__all__ = [
    "Difference",
    "Eds",
    "Finding",
    "Number",
    "Object",
    "ObjectType",
    "Severity",
    "Variable",
    "canopen_text",
    "diff",
    "load",
    "loads",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'axisbus.eds' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
