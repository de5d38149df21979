"""A backup: the settings of one module and its identity; as text it is JSON that a person can read."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from axisbus.drives.gim6010.can_simple.endpoints import Endpoint, Firmware, protected
from axisbus.drives.gim6010.parameters import rules, values
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.parameters.values import Value
from axisbus.errors import ArgumentError, NodeTimeout, StateError
from axisbus.json_document import read_document

_KIND, _VERSION = "axisbus gim6010 backup", 1
_REMEDY = f"give a file of format {_VERSION} that params backup has written"


@dataclass(frozen=True, slots=True)
class ParameterBackup:
    """Values of a module by path, as in its RAM; ``serial`` is its serial number as far as the interface reports it."""

    serial: int
    firmware: Firmware
    values: Mapping[str, Value]
    source: str = "the module"

    @property
    def name(self) -> str:
        return f"gim6010-{self.serial:08X}-{self.firmware}.json"

    def text(self) -> str:
        document = {
            "kind": _KIND,
            "version": _VERSION,
            "serial": f"{self.serial:08X}",
            "firmware": str(self.firmware),
            "values": {path: values.plain(value) for path, value in sorted(self.values.items())},
        }
        return json.dumps(document, indent=1, allow_nan=False) + "\n"


def read(text: str, source: str) -> ParameterBackup:
    """Parse a backup; messages name ``source`` (its file). Raises ArgumentError: it is not a backup, or of another version."""
    what = "a backup of a GIM6010-8"
    found = read_document(
        text, source, kind=_KIND, version=_VERSION, what=what, remedy=_REMEDY, key="version"
    )
    for key in ("serial", "firmware", "values"):
        if key not in found or (key == "values" and not isinstance(found[key], dict)):
            raise ArgumentError(f"{source}: not {what}: it has no {key}", remedy=_REMEDY)
    try:
        serial = int(str(found["serial"]), 16)
    except ValueError:
        raise ArgumentError(f"{source}: its serial number is {found['serial']!r}") from None
    try:
        firmware = Firmware.parse(str(found["firmware"]))
    except ArgumentError as error:
        raise ArgumentError(f"{source}: {error.message}", remedy=error.remedy) from None
    named = {path: values.of_plain(path, value, source) for path, value in found["values"].items()}
    return ParameterBackup(serial, firmware, named, source)


@dataclass(frozen=True, slots=True)
class ParameterDifference:
    """A parameter with two different values; None if it is missing on one side."""

    path: str
    one: Value | None
    other: Value | None

    @property
    def words(self) -> str:
        """Both values, and the reason if it is protected."""
        both = " -> ".join(
            "not there" if each is None else values.show(each) for each in (self.one, self.other)
        )
        found = protected(self.path)
        return f"{self.path}: {both}" + (f" (protected: {found.why})" if found else "")


def differences(one: Mapping[str, Value], other: Mapping[str, Value]) -> list[ParameterDifference]:
    """Return the differences between two sets of values, by path."""
    return [
        ParameterDifference(path, one.get(path), other.get(path))
        for path in sorted({*one, *other})
        if path not in one or path not in other or not values.same(one[path], other[path])
    ]


@dataclass(frozen=True, slots=True)
class RestorePlan:
    """Actions of a restore: ``writes`` in their order, and the parameters that it leaves, each with the reason."""

    writes: tuple[tuple[str, Value], ...]
    left: tuple[tuple[str, str], ...]


def require_same(
    backup: ParameterBackup, module: ModuleParameters, *, other_module: bool, other_firmware: bool
) -> None:
    """Check that a backup is of this module and its firmware. Raises StateError: it is not, and the user has not allowed that."""
    if backup.serial != module.serial and not other_module:
        raise StateError(
            f"{backup.source} is of the module {backup.serial:08X}h, and this one is {module.serial:08X}h",
            remedy="give the backup of this module; to bring one module's settings to another: --other-module",
        )
    if backup.firmware != module.firmware and not other_firmware:
        raise StateError(
            f"{backup.source} is of firmware {backup.firmware}, and the module has {module.firmware}",
            observed="a parameter may mean something else in another firmware",
            remedy="check the differences (params diff); to write it nevertheless: --other-firmware",
        )


def plan(
    backup: ParameterBackup, module: ModuleParameters, present: Mapping[str, Value], named: frozenset[str]
) -> RestorePlan:
    """Return the writes that give a module the backup's values; ``present`` are its present values.

    Protected parameters are written only if they are in ``named``; functions are never called.

    Raises:
        ArgumentError: ``named`` contains a parameter that is not in the backup, or that is never written.
    """
    for path in named:
        if path not in backup.values:
            raise ArgumentError(f"{backup.source} has no {path}", remedy="name a parameter of the backup")
        rules.require_writable(path, by_name=True)
    writes, left = [], []
    for each in differences(present, {path: backup.values[path] for path in backup.values}):
        if each.other is None:
            continue  # the module has it, but the backup does not
        why = _why_not(each.path, module, named)
        if why:
            left.append((each.path, why))
        else:
            writes.append((each.path, each.other))
    return RestorePlan(tuple(writes), tuple(left))


def _why_not(path: str, module: ModuleParameters, named: frozenset[str]) -> str:
    endpoint = module.listed.endpoints.get(path)
    if endpoint is None:
        return "this firmware has no such parameter"
    if not rules.kept(endpoint):
        return "it is not a setting that can be written this way"
    found = protected(path)
    if path == rules.NODE_ID:
        return "it is changed by set-id alone"
    return f"protected: {found.why}; --include {path} writes it" if found and path not in named else ""


# -- Reads many parameters, with the result of each --------------------------------------------------------------------


Told = Callable[[int, int], None]
_MOST = 5  # consecutive parameters without an answer, after which the module counts as lost


@dataclass(slots=True)
class BulkRead:
    """The values read, by path, and the paths that were not answered."""

    values: dict[str, Value] = field(default_factory=dict)
    silent: list[str] = field(default_factory=list)


def read_all(module: ModuleParameters, endpoints: Iterable[Endpoint], tell: Told | None = None) -> BulkRead:
    """Read those of these parameters that the interface can transfer; blocks. ``tell`` is called with the progress.

    Raises:
        BusError: the module restarted or was disconnected meanwhile, or several parameters in a row were not answered.
    """
    wanted = [each for each in endpoints if each.readable and rules.travels(each, module.widest)]
    many, row = BulkRead(), 0
    for number, each in enumerate(wanted):
        try:
            many.values[each.path] = module.read(each.path)
            row = 0
        except NodeTimeout:
            row += 1
            if row >= _MOST:
                raise
            many.silent.append(each.path)
        if tell is not None:
            tell(number + 1, len(wanted))
    return many


def take(module: ModuleParameters, tell: Told | None = None) -> ParameterBackup:
    """Return a backup of a module's settings; blocks.

    Raises:
        StateError: a setting was not answered; an incomplete backup is useless.
        BusError: as ``read_all``.
    """
    many = read_all(module, filter(rules.kept, module.listed.endpoints.values()), tell)
    if many.silent:
        raise StateError(
            f"no backup was made: {', '.join(many.silent)} was not answered",
            remedy="try again, or back it up over USB",
        )
    return ParameterBackup(module.serial, module.firmware, many.values)
