"""Reads many parameters, with the result of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from axisbus.drives.gim6010.can_simple.endpoints import Endpoint
from axisbus.drives.gim6010.parameters import rules
from axisbus.drives.gim6010.parameters.backup import ParameterBackup
from axisbus.drives.gim6010.parameters.interface import ModuleParameters, Value
from axisbus.errors import NodeTimeout, StateError

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
            f"there is no backup: {', '.join(many.silent)} was not answered",
            remedy="try again, or back it up over USB",
        )
    return ParameterBackup(module.serial, module.firmware, many.values)
