"""What is particular to a make of drive: identity, fault tables, quirks."""

from axisbus.drives.make import GENERIC, Make
from axisbus.drives.registry import MAKES, find

__all__ = ["GENERIC", "MAKES", "Make", "find"]
