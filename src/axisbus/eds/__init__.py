"""EDS and DCF files: their contents, with line numbers.

The names below are loaded on first use, because a program that only reads a cell file needs no EDS reader.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from axisbus.eds import writer
    from axisbus.eds.checking import check
    from axisbus.eds.io.canopen_text import canopen_text
    from axisbus.eds.io.reader import load, loads
    from axisbus.eds.model import Eds, EdsFinding, Number, Object, ObjectType, Severity, Variable
    from axisbus.eds.report.compare import diff
    from axisbus.eds.report.consequences import EdsDifference

_HOME = {
    **dict.fromkeys(
        ("Eds", "EdsFinding", "Number", "Object", "ObjectType", "Severity", "Variable"), "axisbus.eds.model"
    ),
    "EdsDifference": "axisbus.eds.report.consequences",
    "canopen_text": "axisbus.eds.io.canopen_text",
    "check": "axisbus.eds.checking",
    "diff": "axisbus.eds.report.compare",
    "load": "axisbus.eds.io.reader",
    "loads": "axisbus.eds.io.reader",
}

__all__ = [
    "Eds",
    "EdsDifference",
    "EdsFinding",
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
    if name == "writer":
        return importlib.import_module("axisbus.eds.writer")
    if name not in _HOME:
        raise AttributeError(f"module 'axisbus.eds' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
