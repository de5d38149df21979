"""What is seen of a module at one moment, asked for anew each time; what is dead in idle is not taken for a value."""

from __future__ import annotations

import math
from dataclasses import dataclass

from axisbus.drives.gim6010.can_simple.states import CLOSED_LOOP
from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.registers import named


@dataclass(frozen=True, slots=True)
class StatusRead:
    """One look; ``at`` in s of the wire's clock is when the first question was sent, turns and turns/s are the rotor's.

    ``position`` and ``velocity`` are None where they are not alive: in any state but closed loop, or where they are no numbers.
    """

    at: float
    state: int
    flags: int
    position: float | None = None
    velocity: float | None = None

    @property
    def is_closed(self) -> bool:
        """Whether there is power on the motor, and a loop that leads it."""
        return self.state == CLOSED_LOOP


def look(module: ModbusModule, tries: int) -> StatusRead:
    """Ask a module how it is; blocks for at most some 0.7 s for each try.

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
