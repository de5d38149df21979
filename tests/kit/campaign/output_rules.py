"""Rules of outputs: none has a value that was not commanded since its module was lost, and at closing they become safe last."""

from __future__ import annotations

import math
from collections.abc import Sequence

from axisbus.errors import StaleError
from axisbus.machine.handle import Handle
from kit.cell import Cell
from kit.plant_probe import OFF

NODE = 5
LAMP = "lamp"  # by which its cell is known
OUTPUTS = {
    LAMP: (0x6200, 1, 3, 0),
    "clamp": (0x6200, 1, 7, 1),
    "fan": (0x6200, 2, 0, 0),
}  # object, bit, safe
TOML = f'[nodes.{NODE}]\neds = "builtin:generic-cia401"\non_lost = "report"\n' + "".join(
    f'[io.{name}]\nnode = {NODE}\nobject = "{index:04X}h:{sub:02X}"\nbit = {bit}\nsafe = {safe}\n'
    for name, (index, sub, bit, safe) in OUTPUTS.items()
)


class Outputs:
    """Holds the allowed values of each output of the module, the set ones, and the violations."""

    def __init__(self, cell: Cell) -> None:
        """The cell has ``TOML`` in it."""
        self.cell = cell
        self.device = cell.machine.simulated_node(NODE).device
        self.set: set[str] = set()
        self.wrong: list[str] = []
        self.early: set[str] = set()  # axes that had power when outputs became safe at closing
        self._allowed = {
            name: {0, safe} for name, (*_, safe) in OUTPUTS.items()
        }  # a module may make them safe on its own
        self._before = {name: self.shown(name) for name in OUTPUTS}
        self._unknown_since: dict[str, float] = {}
        self._asked: dict[str, tuple[float, int]] = {}  # the last commanded value, and when
        self._now = 0.0
        # Of a value that was sent in the cycle before: the node takes it at the SYNC after.
        self._on_its_way = 1.5 * cell.machine.cell.bus.scan_period
        cell.each_cycle(lambda now, _: self._look(now))

    def shown(self, name: str) -> int:
        """The value at the plant."""
        index, sub, bit, _ = OUTPUTS[name]
        return self.device.io.get(index, sub) >> bit & 1

    def knows(self, name: str) -> int | None:
        """The value that the machine reports, None if it is unknown."""
        try:
            return int(self.cell.machine.io[name].value)
        except StaleError:
            return None

    def ask(self, name: str, value: int) -> Handle:
        """Set an output."""
        self._allowed[name] |= {value}
        self._asked[name] = self._now, value
        self.set.add(name)
        return self.cell.machine.io[name].set(bool(value))

    def unsafe(self) -> list[str]:
        """The outputs that were set and are not safe."""
        return [name for name in sorted(self.set) if self.shown(name) != OUTPUTS[name][3]]

    def _look(self, now: float) -> None:
        self._now = now
        leaving = self.cell.machine._core.scan.leaving_because is not None
        for name in OUTPUTS:
            shown, before = self.shown(name), self._before[name]
            if shown not in self._allowed[name]:
                self.wrong.append(f"{name} is {shown} at {now:.3f} s")
            if self.knows(name) is None:  # its value is decided by the module, and is safe later
                since = self._unknown_since.setdefault(name, now)
                if now - since > self._on_its_way:
                    self._allowed[name] = {OUTPUTS[name][3], shown, *self._in_its_buffer(name, since)}
            else:
                self._unknown_since.pop(name, None)
                if leaving and shown != before and shown == OUTPUTS[name][3]:
                    self.early |= set(self._energised())
            self._before[name] = shown

    def _in_its_buffer(self, name: str, since: float) -> set[int]:
        """The value that the node may have received before it was lost; it takes it at the next SYNC, however late that is."""
        at, value = self._asked.get(name, (-math.inf, 0))
        return {value} if at > since - 3 * self._on_its_way else set()

    def _energised(self) -> Sequence[str]:
        return [axis.name for axis in self.cell.machine if self.cell.stage(axis.name) not in OFF]
