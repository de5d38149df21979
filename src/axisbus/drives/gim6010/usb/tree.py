"""Interface to the object tree of a module on USB: its contents, and access to one value at a time.

Implementations are a USB port, and a simulation for tests.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from axisbus.drives.gim6010.parameters.interface import Value


class Gone(Exception):  # named for what happened; only ``parameters`` catches it
    """The module is no longer on the port: it restarts, or was unplugged."""


class Tree(Protocol):
    """Object tree of one module; use it from one thread only. Paths are those of its own list, without ``odrv0.``."""

    @property
    def serial(self) -> int:
        """Serial number, as reported by the port."""

    @property
    def members(self) -> Mapping[str, Mapping[str, Any]]:
        """Its endpoint list: by path, the JSON data of each parameter and function."""

    def read(self, path: str) -> Value:
        """Return a value; blocks.

        Raises:
            Gone: the module is no longer there. NodeError: it does not report the value.
        """

    def write(self, path: str, value: Value) -> None:
        """Write a value; blocks. Raises as ``read``."""

    def call(self, path: str) -> None:
        """Call a function without arguments; blocks. Raises as ``read``."""

    def again(self, seconds: float) -> Tree:
        """Return the same module once it is back on the port; blocks for at most ``seconds``.

        Raises:
            NodeTimeout: it did not come back.
        """
