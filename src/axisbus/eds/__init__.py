"""EDS and DCF files: what they say, with line numbers."""

from axisbus.eds import writer
from axisbus.eds.canopen_text import canopen_text
from axisbus.eds.model import Eds, Finding, Number, Object, ObjectType, Severity, Variable
from axisbus.eds.reader import load, loads

__all__ = [
    "Eds",
    "Finding",
    "Number",
    "Object",
    "ObjectType",
    "Severity",
    "Variable",
    "canopen_text",
    "load",
    "loads",
    "writer",
]
