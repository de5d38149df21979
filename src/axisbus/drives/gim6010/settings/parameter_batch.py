"""Parameters that are set together: written and read back one by one, or told as the steps over USB."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from axisbus.drives.gim6010.can_simple.endpoint_messages import value_bytes
from axisbus.drives.gim6010.parameters import rules, values
from axisbus.drives.gim6010.parameters.interface import ModuleParameters, Value

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class ParameterBatch:
    """Parameters by path with their values, in the order in which they are written; ``notes`` are what a person has to know."""

    values: tuple[tuple[str, Value], ...]
    notes: tuple[str, ...] = ()

    @property
    def over_usb(self) -> tuple[str, ...]:
        """The same as steps over USB, saved at the end."""
        return (
            "connect it by USB and open odrivetool; it must be idle",
            *(f"odrv0.{path} = {value!r}" for path, value in self.values),
            "odrv0.save_configuration(), after which it restarts",
        )


def check(module: ModuleParameters, wanted: ParameterBatch) -> None:
    """Check that all of it can be written, before the first is.

    Raises:
        ArgumentError, LimitError: a parameter is not there, not for writing, or a value is not of its type.
    """
    for path, value in wanted.values:
        endpoint = module.endpoint(path)
        rules.require_setting(endpoint, by_name=True)
        value_bytes(endpoint, value)


def apply(module: ModuleParameters, wanted: ParameterBatch, tell: Tell) -> None:
    """Write all of it into RAM, each read back; ``tell`` hears of each one that is there. Blocks.

    Raises:
        ArgumentError, LimitError: as ``check``; nothing is written then.
        StateError: the module is not idle. BusError: no answer, another value is held, or the module restarted or left.
    """
    check(module, wanted)
    for path, value in wanted.values:
        before = module.read(path)
        held = module.write(path, value, by_name=True)
        tell(f"{path} = {values.show(held)} (was {values.show(before)})")


def shown(module: ModuleParameters, paths: tuple[str, ...]) -> Iterator[str]:
    """Yield the present values of parameters, as they are in RAM; blocks, raises as ``ModuleParameters.read``."""
    for path in paths:
        yield f"{path} = {values.show(module.read(path))}"
