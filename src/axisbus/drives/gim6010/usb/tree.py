"""The tree of a module on USB: what it says that it has, and one value at a time; a USB port is one, arithmetic another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from axisbus.drives.gim6010.parameters.interface import Value


class Gone(Exception):  # what happened; nobody but ``parameters`` sees it
    """The module is no longer on the port: it restarts, or was unplugged."""


class Tree(Protocol):
    """One module; used by one thread. Paths are those of its own list, without ``odrv0.``."""

    @property
    def serial(self) -> int:
        """The serial number by which its port names it."""

    @property
    def members(self) -> Mapping[str, Mapping[str, Any]]:
        """Its own list of endpoints: by path, what the list's JSON has of each parameter and function."""

    def read(self, path: str) -> Value:
        """Return a value; blocks.

        Raises:
            Gone: it is no longer there. NodeError: it does not tell it.
        """

    def write(self, path: str, value: Value) -> None:
        """Write a value; blocks. Raises as ``read``."""

    def call(self, path: str) -> None:
        """Call a function without arguments; blocks. Raises as ``read``."""

    def again(self, seconds: float) -> Tree:
        """Return the same module once it is back on the port; blocks for at most so many seconds.

        Raises:
            NodeTimeout: it is not.
        """
