"""Simulated modules on a private virtual bus, and bystanders that talk and count on it."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import can

from axisbus.drives.gim6010.sim.module import Module
from axisbus.sim.node.network import SimulatedNetwork
from kit.sending_device import Talker

_channels = (f"modules-{os.getpid()}-{number}" for number in itertools.count())


@contextmanager
def modules_on_bus(*modules: Module) -> Iterator[str]:
    """Let modules live on a bus; yields the channel's name."""
    name = next(_channels)
    with SimulatedNetwork(name, [], foreign_nodes=modules):
        yield name


class Bystander(Talker):
    """Sends some frames every 50 ms and stores those of others; ``answer`` gives frames to each received one."""

    def __init__(
        self,
        channel: str,
        says: Sequence[tuple[int, bytes]] = (),
        answer: Callable[[can.Message], Sequence[can.Message]] = lambda _: (),
    ) -> None:
        super().__init__(channel)
        self.says = says
        self.answer = answer
        self.heard: list[can.Message] = []

    def _talk(self) -> None:
        while not self._over.is_set():
            for can_id, data in self.says:
                self._bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=can_id > 0x7FF))
            message = self._bus.recv(0.05)
            while message is not None:
                self.heard.append(message)
                for each in self.answer(message):
                    self._bus.send(each)
                message = self._bus.recv(0.0)
