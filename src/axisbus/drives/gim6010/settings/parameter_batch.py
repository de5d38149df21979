"""Parameters that are set together: written and read back one by one, or listed as steps over USB."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from axisbus.drives.gim6010.can_simple.endpoint_messages import value_bytes
from axisbus.drives.gim6010.parameters import rules, values
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.parameters.values import Value

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class ParameterBatch:
    """Parameters by path with their values, in the order of writing; ``notes`` are remarks for the user."""

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
    """Check that all parameters can be written, before writing the first.

    Raises:
        ArgumentError, LimitError: a parameter does not exist, is not writable, or a value is not of its type.
    """
    for path, value in wanted.values:
        endpoint = module.endpoint(path)
        rules.require_setting(endpoint, by_name=True)
        value_bytes(endpoint, value)


def apply(module: ModuleParameters, wanted: ParameterBatch, tell: Tell) -> None:
    """Write all parameters into RAM, and read each back; ``tell`` is called for each written one. Blocks.

    Raises:
        ArgumentError, LimitError: as ``check``; nothing was written then.
        StateError: the module is not idle.
        BusError: no answer, the module stores another value, or it restarted or was disconnected.
    """
    check(module, wanted)
    for path, value in wanted.values:
        before = module.read(path)
        held = module.write(path, value, by_name=True)
        tell(f"{path} = {values.show(held)} (was {values.show(before)})")


def shown(module: ModuleParameters, paths: tuple[str, ...]) -> Iterator[str]:
    """Yield the present values of parameters in RAM; blocks, raises as ``ModuleParameters.read``."""
    for path in paths:
        yield f"{path} = {values.show(module.read(path))}"
