"""Rules of a CAN Simple module beside the axes of a scene: energised only when commanded, and at standstill and off in the end.

It gets commands and faults of its own, derived from the numbers of the other axes, and is judged by its own shaft.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from contextlib import suppress

from axisbus.errors import AxisbusError
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from kit.cell import Cell

NODE, NAME = 5, "m"  # an ID that goes with the CANopen nodes 1 and 2
TOML = f"""[nodes.{NODE}]
protocol = "can_simple"
firmware = "0.5.13"
[nodes.{NODE}.can_simple]
velocity_limit = 20.0
current_limit = 20.0
velocity_ramp = 40.0
acceleration = 80.0
[axes.{NAME}]
node = {NODE}
unit = "deg"
scale = "131072/360"
max_velocity = 400.0
standstill_window = 2.0
[axes.{NAME}.defaults]
velocity = 100.0
acceleration = 500.0
[axes.{NAME}.homing]
method = 37
[axes.{NAME}.stop]
quick_stop = "ramp"
"""
RESTS = 0.02  # turns/s of the rotor
_LATE = 0.5  # s after its end in which an enable may still take effect
_HONEST = ("could not be confirmed", "NOT CONFIRMED", "MOVING", "still energised", "is lost", "not known")

Order = Callable[[Axis, float], Handle]
ORDERS: tuple[Order, ...] = (
    lambda axis, _: axis.enable(),
    lambda axis, _: axis.enable(),
    lambda axis, value: axis.move_relative(300.0 * value),
    lambda axis, value: axis.move_relative(300.0 * value, buffer=True),
    lambda axis, value: axis.move_velocity(200.0 * value),
    lambda axis, value: axis.move_velocity(200.0 * value),
    lambda axis, _: axis.home(),
    lambda axis, _: axis.halt(),
    lambda axis, _: axis.stop(),
    lambda axis, _: axis.release(),
    lambda axis, _: axis.quick_stop(),
    lambda axis, _: axis.disable(),
    lambda axis, _: axis.reset(),
)
_RESET = ORDERS[-1]
# Fault settings with their values; the first ones end the faults of the others.
DIALS: tuple[Mapping[str, object], ...] = (
    {"motor_error": 0, "dead": False, "heartbeat_stops": False, "estimates_stop": False, "blocked": False},
    {"motor_error": 0, "dead": False, "heartbeat_stops": False, "estimates_stop": False, "blocked": False},
    {"motor_error": 0x20000},
    {"dead": True},
    {"heartbeat_stops": True},
    {"estimates_stop": True},
    {"blocked": True},
)


class Beside:
    """Holds the module, its commands, and the violations."""

    def __init__(self, cell: Cell) -> None:
        """The cell has ``TOML`` in it."""
        self._cell = cell
        self._axis = cell.machine[NAME]
        self.module = cell.machine.simulated_node(NODE).module  # type: ignore[attr-defined]
        self.given: list[Handle] = []
        self.wrong: list[str] = []
        self._enables: list[tuple[Handle, float | None]] = []  # with when each was seen to have ended
        self._was_on = self.module.energised
        self._chance = random.Random(len(cell.machine.cell.source))
        cell.each_cycle(lambda now, _: self._look(now))

    def happen(self, value: float) -> None:
        """Give it a command, or a fault, by a number from -1 to 1."""
        number = round(abs(value) * 100)
        if not number:  # the event that brings the others back into service
            self._turn(DIALS[0])
            for order in (_RESET, *ORDERS[:1], *ORDERS[4:6]):
                self._give(order, self._chance.uniform(-1.0, 1.0))
            return
        if number % 7 == 0:
            self._turn(DIALS[number // 7 % len(DIALS)])
            if number == 35:
                self.module.restart()
            return
        self._give(ORDERS[number % len(ORDERS)], value)

    def _turn(self, dials: Mapping[str, object]) -> None:
        for dial, to in dials.items():
            setattr(self.module.dials, dial, to)

    def _give(self, order: Order, value: float) -> None:
        with suppress(AxisbusError):
            handle = order(self._axis, value)
            self.given.append(handle)
            if order in ORDERS[:2]:
                self.enabled_by(handle)

    def enabled_by(self, handle: Handle) -> None:
        """An enable of its group was given."""
        self._enables.append((handle, None))

    def is_out_of_reach(self, text: str) -> bool:
        """Whether the master reports that it may move or still be energised, or cannot receive whether it does."""
        error = self._axis.error
        lines = [str(error)] if error is not None else []
        lines += [part for part in text.split("\0") if f"{NAME}: " in part or f"[{NAME}]" in part]
        return any(word in line for line in lines for word in _HONEST)

    def unsafe(self, text: str) -> str:
        """Return the violations in its final state, as text; ``text`` is the report about it."""
        shaft = self.module.shaft
        if self.is_out_of_reach(text):
            return ""
        if abs(shaft.speed) > RESTS or self.module.energised:
            return f"it turns at {shaft.speed:g} turns/s, energised: {self.module.energised}; it was said {text!r}"
        return ""

    def _look(self, now: float) -> None:
        self._enables = [
            (handle, ended if ended is not None or handle.busy else now) for handle, ended in self._enables
        ]
        if self.module.energised and not self._was_on:
            asked = any(ended is None or now - ended < _LATE for _, ended in self._enables)
            if not asked:
                self.wrong.append(f"it got power at {now:.3f} s, and nobody had asked for that")
        self._was_on = self.module.energised
