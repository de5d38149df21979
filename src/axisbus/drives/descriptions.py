"""The descriptions of the plug-ins of this package that have code: what must be known before any of their modules is imported.

Such a plug-in is a folder with a file ``plugin.toml``, and with its ``DrivePlugin`` as ``PLUGIN`` in its module ``make``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from axisbus.drives.plugin import Extension

_PACKAGE = __name__.rpartition(".")[0]


@dataclass(frozen=True, slots=True)
class PluginDescription:
    """A file ``plugin.toml``: the ``name`` of its folder, the vendor of the drives, what the plug-in adds, and its ``commands``.

    Each command of the command line has a module (with ``command``, of click) and a line of help.
    """

    name: str
    vendor_id: int
    extension: Extension
    commands: Mapping[str, tuple[str, str]]

    @property
    def module(self) -> str:
        """The module with the plug-in."""
        return f"{_PACKAGE}.{self.name}.make"


@cache
def descriptions() -> tuple[PluginDescription, ...]:
    """Return all descriptions. Blocks while they are read."""
    return tuple(map(_read, sorted(Path(__file__).parent.glob("*/plugin.toml"))))


def _read(path: Path) -> PluginDescription:
    description = tomllib.loads(path.read_text(encoding="utf-8"))
    return PluginDescription(
        path.parent.name,
        description["vendor_id"],
        Extension(description["protocols"], description["interfaces"], description["parts"]),
        description["commands"],
    )
