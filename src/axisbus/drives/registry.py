"""Find the drive plug-ins: those of this package, and those of installed packages by their entry points.

An entry point of the group ``axisbus.drives`` names a ``DrivePlugin``, a list of them, or a package whose TOML files each describe
a make. Nothing is loaded before a cell, a scan or a command asks for a plug-in. A plug-in that cannot be loaded is reported with
its error, and the others are loaded all the same.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.resources import files
from types import ModuleType
from typing import Protocol

from axisbus.drives import drive_file
from axisbus.drives.plugin import GENERIC, DrivePlugin
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError

GROUP = "axisbus.drives"
_OWN = __name__.rpartition(".")[0]


@dataclass(frozen=True, slots=True)
class PluginSource:
    """A place that plug-ins come from: its ``name``, its ``origin`` for the user, and its plug-ins or the error of loading them."""

    name: str
    origin: str
    plugins: tuple[DrivePlugin, ...] = ()
    error: str = ""
    remedy: str = ""


class DriveIdentity(Protocol):
    """What a drive is by 1018h:01 to 03, as an EDS or the drive itself gives it; None: unknown."""

    @property
    def vendor_id(self) -> int | None: ...

    @property
    def product_code(self) -> int | None: ...

    @property
    def revision(self) -> int | None: ...


@cache
def installed() -> tuple[PluginSource, ...]:
    """Return all sources of plug-ins: first those of other packages, then those of this one. Blocks while they are imported."""
    others = sorted(entry_points(group=GROUP), key=lambda entry: entry.name)
    return (*map(_of_entry_point, others), *_own())


def plugins() -> tuple[DrivePlugin, ...]:
    """Return the plug-ins of all sources that could be loaded."""
    return tuple(plugin for source in installed() for plugin in source.plugins)


def make_of(eds: Eds, own: Iterable[DrivePlugin] = ()) -> DrivePlugin:
    """Return the plug-in for the identity in an EDS, which boot-up compares with the node's identity; ``own`` as in ``find``."""
    return of_identity(eds.identity, own)


def of_identity(who: DriveIdentity, own: Iterable[DrivePlugin] = ()) -> DrivePlugin:
    """Return the plug-in of a drive by its identity, as ``find``."""
    return find(who.vendor_id, who.product_code, who.revision, own)


def find(
    vendor_id: int | None,
    product_code: int | None,
    revision: int | None = None,
    own: Iterable[DrivePlugin] = (),
) -> DrivePlugin:
    """Return the plug-in of a drive by 1018h:01 to 03 (None: unknown); ``GENERIC`` if none matches.

    The plug-ins that a cell names by file (``own``) precede all others. Of several that match, the one with the closest identity
    is returned.
    """
    if vendor_id is None:
        return GENERIC
    for known in (tuple(own), plugins()):
        fitting = [each for each in known if each.matches(vendor_id, product_code, revision)]
        if fitting:
            return max(fitting, key=lambda each: each.detail)
    return GENERIC


def _own() -> Iterator[PluginSource]:
    """Yield the makes of this package: each folder with a module ``make`` or with TOML files is a source."""
    for found in pkgutil.iter_modules(importlib.import_module(_OWN).__path__):
        if not found.ispkg:
            continue
        package = f"{_OWN}.{found.name}"
        if importlib.util.find_spec(f"{package}.make") is not None:
            plugins = _plugins(importlib.import_module(f"{package}.make").PLUGIN)
        else:
            plugins = _plugins(importlib.import_module(package))
        yield PluginSource(found.name, "axisbus", plugins)


def _of_entry_point(entry: EntryPoint) -> PluginSource:
    package = entry.dist
    origin = f"{package.name} {package.version}" if package is not None else entry.value
    try:
        return PluginSource(entry.name, origin, _plugins(entry.load()))
    except Exception as error:  # noqa: BLE001  a package of somebody else may fail in any way
        told = str(error) if isinstance(error, AxisbusError) else f"{type(error).__name__}: {error}"
        remedy = f"update or uninstall the package {package.name}" if package is not None else ""
        return PluginSource(entry.name, origin, error=f"{entry.value}: {told}", remedy=remedy)


def _plugins(loaded: object) -> tuple[DrivePlugin, ...]:
    """Return the plug-ins that an entry point names.

    Raises:
        TypeError: it names something else.
        ConfigError: a TOML file of the package has an error.
    """
    if isinstance(loaded, ModuleType):
        texts = sorted(files(loaded).iterdir(), key=lambda file: file.name)
        return tuple(drive_file.of_resource(file) for file in texts if file.name.endswith(".toml"))
    several = tuple(loaded) if isinstance(loaded, (list, tuple)) else (loaded,)
    if not all(isinstance(each, DrivePlugin) for each in several):
        raise TypeError(f"this is not a DrivePlugin, a list of them or a package with TOML files: {loaded!r}")
    return several
