"""Random commands for outputs and random faults: no output has a value that was not commanded since its node was lost."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from axisbus.cia301.nmt import NmtCommand
from axisbus.errors import NodeError
from axisbus.machine.handle import Handle
from kit.campaign.output_rules import OUTPUTS, TOML, Outputs
from kit.cell import Cell, cell_text


class Game:
    """A cell, and the commands that were given."""

    def __init__(self, scenario, seed: int) -> None:
        self.dice = random.Random(seed)
        self.cell: Cell = scenario.simulated(text=cell_text("", more=TOML))
        self.outputs = Outputs(self.cell)
        self.device = self.outputs.device
        self.given: list[Handle] = []

    def ask(self) -> None:
        name, value = self.dice.choice(list(OUTPUTS)), self.dice.randrange(2)
        if self.outputs.knows(name) is not None or self.dice.random() < 0.3:
            self.given.append(self.outputs.ask(name, value))

    def nmt(self, command: NmtCommand) -> Callable[[], None]:
        return lambda: self.cell.nmt(command, 5)

    def turn(self, of: str, dial: str, value: object) -> Callable[[], None]:
        dials = self.device.dials if of == "node" else self.cell.faults
        return lambda: setattr(dials, dial, value)

    @property
    def mishaps(self) -> list[tuple[Callable[[], None], Callable[[], None]]]:
        """The possible faults, and their end."""
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
        self.cell.nmt(NmtCommand.START, 5)  # if its own monitoring has switched it to pre-operational
        self.cell.run(1.0)

    def settled(self) -> None:
        """With the node present, each output has the value that the machine reports, or was never set; every command has ended."""
        assert self.outputs.wrong == []
        assert not any(handle.busy for handle in self.given)
        for name in self.outputs.set:
            assert self.outputs.knows(name) in (None, self.outputs.shown(name))
        for handle in self.given:
            assert isinstance(handle.exception(), NodeError | None)


@pytest.mark.parametrize("seed", range(25))
def test_no_output_has_a_value_that_was_not_commanded(scenario, seed):
    game = Game(scenario, seed)
    game.play()
    game.settled()
    game.cell.ctrl_c(5.0)
    game.cell.run(0.05)  # the frames are still in transit
    assert game.outputs.unsafe() == []
