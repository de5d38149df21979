"""Finds the modules on a line: sends one request to each node ID, and reads the state of those that answer. Writes nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from axisbus.drives.gim6010.can_simple.states import state_words
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.requests import Wire
from axisbus.errors import NodeError


@dataclass(frozen=True, slots=True)
class Present:
    """A module that answers: its node ID, state and supply voltage (V); ``trouble``: its errors, or why its data are incomplete."""

    device: int
    state: int | None = None
    voltage: float | None = None
    trouble: str = ""

    def __str__(self) -> str:
        state = "its state is not known" if self.state is None else state_words(self.state)
        supply = "" if self.voltage is None else f", {self.voltage:.1f} V"
        return f"node {self.device}: {state}{supply}" + (f"; {self.trouble}" if self.trouble else "")


def present(wire: Wire, devices: Iterable[int]) -> Iterator[Present | int]:
    """Send a request to each of ``devices`` (1 to 247); yield the modules found, and the number of each that does not answer.

    Blocks for the wire's ``timeout`` for each that does not answer.

    Raises:
        AdapterError: the line is gone.
    """
    for device in devices:
        module = ModbusModule(wire, device)
        try:
            answers = module.answers()
        except NodeError as error:  # an exception is an answer, too
            yield Present(device, trouble=error.message)
            continue
        yield _look(module) if answers else device


def _look(module: ModbusModule) -> Present:
    try:
        state, voltage, errors = module.state, float(module.read("bus_voltage")), module.errors()
    except NodeError as error:
        return Present(module.device, trouble=error.message)
    return Present(module.device, state, voltage, "; ".join(errors.lines))
