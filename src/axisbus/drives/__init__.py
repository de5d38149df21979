"""Drive plug-ins: properties of a vendor's drive family, such as identity, fault tables and quirks."""

from axisbus.drives.make import GENERIC, Make
from axisbus.drives.registry import MAKES, find

__all__ = ["GENERIC", "MAKES", "Make", "find"]
