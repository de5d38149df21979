"""Find the drive plug-ins: those of this package, and those of installed packages by their entry points.

An entry point of the group ``axisbus.drives`` names a ``DrivePlugin``, a list of them, or a package whose TOML files each describe
a make. Nothing is loaded before a cell, a scan or a command asks for a plug-in. A plug-in that cannot be loaded is reported with
its error, and the others are loaded all the same.

A plug-in of this package that has code is described by a file (``descriptions``), so that none of its modules is imported for other
drives.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.resources import files
from types import ModuleType
from typing import Any, Protocol

from axisbus.drives import drive_file
from axisbus.drives.descriptions import PluginDescription, descriptions
from axisbus.drives.plugin import GENERIC, DrivePlugin, Extension
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError

GROUP = "axisbus.drives"
_PACKAGE = __name__.rpartition(".")[0]


@dataclass(frozen=True, slots=True)
class PluginSource:
    """A place that plug-ins come from: its ``name``, its ``origin`` for the user, and its plug-ins or the error of loading them.

    ``about`` is the description of a plug-in whose module is imported when it is needed.
    """

    name: str
    origin: str
    loaded: tuple[DrivePlugin, ...] = ()
    error: str = ""
    remedy: str = ""
    about: PluginDescription | None = None

    @property
    def plugins(self) -> tuple[DrivePlugin, ...]:
        """The plug-ins. Blocks while their module is imported."""
        return self.loaded if self.about is None else _plugins(load(f"{self.about.module}:PLUGIN"))

    def of_vendor(self, vendor_id: int | None) -> tuple[DrivePlugin, ...]:
        """Return the plug-ins that may be for a vendor's drives (None: all); imports no module for another vendor."""
        other = self.about is not None and vendor_id not in (None, self.about.vendor_id)
        return () if other else self.plugins

    @property
    def extensions(self) -> tuple[Extension, ...]:
        """The parts that plug-ins add, in addition to facts."""
        return (
            tuple(plugin.extension for plugin in self.loaded)
            if self.about is None
            else (self.about.extension,)
        )


class DriveIdentity(Protocol):
    """The identity of a drive (1018h:01 to 03), as given by an EDS or the drive itself; None: unknown."""

    @property
    def vendor_id(self) -> int | None: ...

    @property
    def product_code(self) -> int | None: ...

    @property
    def revision(self) -> int | None: ...


@cache
def installed() -> tuple[PluginSource, ...]:
    """Return all sources of plug-ins: first those of other packages, then those of this one. Blocks while those are imported."""
    others = sorted(entry_points(group=GROUP), key=lambda entry: entry.name)
    return (*map(_of_entry_point, others), *_built_in())


def plugins(vendor_id: int | None = None) -> tuple[DrivePlugin, ...]:
    """Return the plug-ins of all sources that could be loaded; with ``vendor_id`` those that may be for drives of this vendor."""
    return tuple(plugin for source in installed() for plugin in source.of_vendor(vendor_id))


def make_of(eds: Eds, cell_plugins: Iterable[DrivePlugin] = ()) -> DrivePlugin:
    """Return the plug-in for the identity in an EDS, which boot-up compares with the node's; ``cell_plugins`` as in ``find``."""
    return of_identity(eds.identity, cell_plugins)


def of_identity(identity: DriveIdentity, cell_plugins: Iterable[DrivePlugin] = ()) -> DrivePlugin:
    """Return the plug-in of a drive by its identity, as ``find``."""
    return find(identity.vendor_id, identity.product_code, identity.revision, cell_plugins)


def find(
    vendor_id: int | None,
    product_code: int | None,
    revision: int | None = None,
    cell_plugins: Iterable[DrivePlugin] = (),
) -> DrivePlugin:
    """Return the plug-in of a drive by 1018h:01 to 03 (None: unknown); ``GENERIC`` if none matches.

    The plug-ins that a cell names by file (``cell_plugins``) precede all others. Of several that match, the one with the closest
    identity is returned.
    """
    if vendor_id is None:
        return GENERIC
    for known in (tuple(cell_plugins), plugins(vendor_id)):
        fitting = [each for each in known if each.matches(vendor_id, product_code, revision)]
        if fitting:
            return max(fitting, key=lambda each: each.detail)
    return GENERIC


# -- What plug-ins add beside facts: other protocols, interfaces, and parts that extend a package of axisbus -----------


def extensions() -> tuple[Extension, ...]:
    """Return what the plug-ins add beside facts; loads none of it."""
    return tuple(each for source in installed() for each in source.extensions)


def protocols() -> dict[str, str]:
    """Return the protocols other than CANopen: the word for each in a cell file, and its name in messages."""
    return {word: name for each in extensions() for word, name in each.protocols.items()}


def interfaces() -> dict[str, str]:
    """Return the interfaces of plug-ins: the word for each in ``[bus]``, and the ``module:name`` of its class."""
    return {word: code for each in extensions() for word, code in each.interfaces.items()}


def parts(package: str, *words: str) -> list[Any]:
    """Return the parts of plug-ins that extend a package; with ``words`` only of those with one of these protocols or interfaces.

    Blocks while they are imported.
    """
    return [
        load(each.parts[package])
        for each in extensions()
        if package in each.parts and (not words or not {*each.protocols, *each.interfaces}.isdisjoint(words))
    ]


def load(code: str) -> Any:
    """Import ``module:name``, and return what is named."""
    module, _, name = code.partition(":")
    return getattr(importlib.import_module(module), name)


def _built_in() -> Iterator[PluginSource]:
    """Yield the makes of this package: each folder with a description, and each with drive files, is a source."""
    described = {about.name: about for about in descriptions()}
    for found in pkgutil.iter_modules(importlib.import_module(_PACKAGE).__path__):
        if found.name in described:
            yield PluginSource(found.name, "axisbus", about=described[found.name])
        elif found.ispkg:
            yield PluginSource(
                found.name, "axisbus", _plugins(importlib.import_module(f"{_PACKAGE}.{found.name}"))
            )


def _of_entry_point(entry: EntryPoint) -> PluginSource:
    package = entry.dist
    origin = f"{package.name} {package.version}" if package is not None else entry.value
    try:
        return PluginSource(entry.name, origin, _plugins(entry.load()))
    except Exception as error:  # noqa: BLE001  a package of somebody else may fail in any way
        reason = str(error) if isinstance(error, AxisbusError) else f"{type(error).__name__}: {error}"
        remedy = f"update or uninstall the package {package.name}" if package is not None else ""
        return PluginSource(entry.name, origin, error=f"{entry.value}: {reason}", remedy=remedy)


def _plugins(loaded: object) -> tuple[DrivePlugin, ...]:
    """Return the plug-ins that an entry point names.

    Raises:
        TypeError: it names neither a plug-in, nor a list of them, nor a package with drive files.
        ConfigError: a TOML file of the package has an error.
    """
    if isinstance(loaded, ModuleType):
        texts = sorted(files(loaded).iterdir(), key=lambda file: file.name)
        return tuple(drive_file.of_resource(file) for file in texts if file.name.endswith(".toml"))
    several = tuple(loaded) if isinstance(loaded, (list, tuple)) else (loaded,)
    if not all(isinstance(each, DrivePlugin) for each in several):
        raise TypeError(f"this is not a DrivePlugin, a list of them or a package with TOML files: {loaded!r}")
    return several
