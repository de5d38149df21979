"""Random commands for outputs and random mishaps: no output has a value that nobody asked for since its node was lost."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from axisbus.cia301.nmt import NmtCommand
from axisbus.errors import NodeError, StaleError
from axisbus.machine.handle import Handle
from kit.cell import Cell, cell_text

OUTPUTS = {"lamp": (0x6200, 1, 3, 0), "clamp": (0x6200, 1, 7, 1), "fan": (0x6200, 2, 0, 0)}
IO = '[nodes.5]\neds = "builtin:generic-cia401"\non_lost = "tell"\n' + "".join(
    f'[io.{name}]\nnode = 5\nobject = "{index:04X}h:{sub:02X}"\nbit = {bit}\nsafe = {safe}\n'
    for name, (index, sub, bit, safe) in OUTPUTS.items()
)


class Game:
    """A cell, what each output may be now, and what was asked for."""

    def __init__(self, story, seed: int) -> None:
        self.dice = random.Random(seed)
        self.cell: Cell = story.simulated(text=cell_text("", more=IO))
        self.device = self.cell.machine.stand_in(5).device
        self.allowed = {
            name: {0, safe} for name, (*_, safe) in OUTPUTS.items()
        }  # a module may be safe by itself
        self.under_way: list[tuple[str, int, Handle]] = []
        self.set: set[str] = set()
        self.cell.each_cycle(lambda *_: self.look())

    def shown(self, name: str) -> int:
        index, sub, bit, _ = OUTPUTS[name]
        return self.device.io.get(index, sub) >> bit & 1

    def look(self) -> None:
        for name in OUTPUTS:
            assert self.shown(name) in self.allowed[name], f"{name} is {self.shown(name)}"
            if self.machine_knows(name) is None:  # what it has is left to the module, and then is safe
                self.allowed[name] = {OUTPUTS[name][3], self.shown(name)}

    def machine_knows(self, name: str) -> int | None:
        try:
            return int(self.cell.machine.io[name].value)
        except StaleError:
            return None

    def ask(self) -> None:
        name, value = self.dice.choice(list(OUTPUTS)), self.dice.randrange(2)
        if self.machine_knows(name) is not None or self.dice.random() < 0.3:
            self.allowed[name] |= {value}
            self.set.add(name)
            self.under_way.append((name, value, self.cell.machine.io[name].set(bool(value))))

    def nmt(self, command: NmtCommand) -> Callable[[], None]:
        return lambda: self.cell.cycle.nmt(command, 5)

    def turn(self, of: str, dial: str, value: object) -> Callable[[], None]:
        dials = self.device.dials if of == "node" else self.cell.cycle.dials
        return lambda: setattr(dials, dial, value)

    @property
    def mishaps(self) -> list[tuple[Callable[[], None], Callable[[], None]]]:
        """What may happen, and its end."""
        return [
            (self.turn("node", "dead", True), self.turn("node", "dead", False)),
            (self.turn("node", "heartbeat_stops", True), self.turn("node", "heartbeat_stops", False)),
            (self.turn("bus", "heartbeat_lost", True), self.turn("bus", "heartbeat_lost", False)),
            (self.turn("bus", "sync_lost", True), self.turn("bus", "sync_lost", False)),
            (self.turn("bus", "wait_late", 0.13), self.turn("bus", "wait_late", 0.0)),
            (self.nmt(NmtCommand.ENTER_PRE_OPERATIONAL), self.nmt(NmtCommand.START)),
            (self.nmt(NmtCommand.STOP), self.nmt(NmtCommand.START)),
        ]

    def play(self) -> None:
        for _ in range(6):
            for _ in range(self.dice.randrange(4)):
                self.ask()
                self.cell.run(self.dice.choice((0.0, 0.01, 0.05)))
            begin, end = self.dice.choice(self.mishaps)
            begin()
            for _ in range(self.dice.randrange(3)):
                self.cell.run(self.dice.choice((0.02, 0.15, 0.6)))
                self.ask()
            self.cell.run(self.dice.choice((0.02, 0.6)))
            end()
            self.cell.run(self.dice.choice((0.0, 0.5)))
        self.cell.cycle.nmt(NmtCommand.START, 5)  # where its own watch has led it to pre-operational
        self.cell.run(1.0)

    def settled(self) -> None:
        """With the node there, each output is what the machine says, or was never set; and every command has ended."""
        assert not any(handle.busy for _, _, handle in self.under_way)
        for name in self.set:
            assert self.machine_knows(name) in (None, self.shown(name))
        for _, _, handle in self.under_way:
            assert isinstance(handle.exception(), NodeError | None)


@pytest.mark.parametrize("seed", range(25))
def test_no_output_has_what_nobody_asked_for(story, seed):
    game = Game(story, seed)
    game.play()
    game.settled()
    touched = {name for name, _, handle in game.under_way if handle.exception() is None}
    game.cell.ctrl_c(5.0)
    for name in touched:
        assert game.shown(name) == OUTPUTS[name][3], name
