"""One reading of a module's state; values that are not valid in idle are unknown."""

from __future__ import annotations

import math
from dataclasses import dataclass

from axisbus.drives.gim6010.can_simple.states import CLOSED_LOOP
from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.registers import named


@dataclass(frozen=True, slots=True)
class StatusRead:
    """One reading; ``at`` is the time of its first request, in s of the wire's clock. Turns and turns/s are those of the rotor.

    ``position`` and ``velocity`` are None if they are not valid: in any state except closed loop, or if they are not numbers.
    """

    at: float
    state: int
    flags: int
    position: float | None = None
    velocity: float | None = None

    @property
    def is_closed(self) -> bool:
        """Whether the motor is energised and in closed loop."""
        return self.state == CLOSED_LOOP


def look(module: ModbusModule, tries: int) -> StatusRead:
    """Read the state of a module; blocks for at most about 0.7 s for each try.

    Raises:
        NodeError: no answer, or an exception. AdapterError: the line is gone.
    """
    at = module.wire.now()
    state, flags = int(_ask(module, "motor_state", tries)), int(_ask(module, "error_flags", tries))
    if state != CLOSED_LOOP:
        return StatusRead(at, state, flags)
    position, velocity = (
        _number(module, "position_feedback", tries),
        _number(module, "velocity_feedback", tries),
    )
    return StatusRead(at, state, flags, position, velocity)


def _number(module: ModbusModule, name: str, tries: int) -> float | None:
    found = _ask(module, name, tries)
    return found if math.isfinite(found) else None


def _ask(module: ModbusModule, name: str, tries: int) -> float:
    register = named(name)
    return register.value(module.dialogue.read(requests.read(register), tries))
