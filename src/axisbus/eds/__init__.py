"""EDS and DCF files: what they say, with line numbers.

What compares files is loaded when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from axisbus.eds import writer
from axisbus.eds.checking import check
from axisbus.eds.io.canopen_text import canopen_text
from axisbus.eds.io.reader import load, loads
from axisbus.eds.model import Eds, Finding, Number, Object, ObjectType, Severity, Variable

if TYPE_CHECKING:
    from axisbus.eds.report.compare import diff
    from axisbus.eds.report.difference import Difference

_HOME = {"Difference": "axisbus.eds.report.difference", "diff": "axisbus.eds.report.compare"}

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
    "check",
    "diff",
    "load",
    "loads",
    "writer",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'axisbus.eds' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
