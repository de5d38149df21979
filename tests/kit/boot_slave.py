"""A node that is booted without a bus: a table of objects, with faults."""

from __future__ import annotations

import random

from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia302 import types as b
from axisbus.cia302.bootup import boot_up

MISSING = 0x0602_0000


class Slave:
    """A node as a table of objects, which answers requests; holds the received requests and its faults."""

    def __init__(self, **objects: int) -> None:
        self.objects = {
            (0x1000, 0): 0x00020192,
            (0x1018, 1): 0x123,
            (0x1018, 2): 0x456,
            (0x1018, 3): 0x10002,
            (0x1018, 4): 777,
            (0x1017, 0): 0,
            (0x100C, 0): 0,
            (0x100D, 0): 0,
            (0x1011, 1): 1,
            (0x6065, 0): 0,
            (0x6067, 0): 0,
        }
        self.state = NmtState.PRE_OPERATIONAL
        self.dead = False
        self.dies_at: b.Request | None = None
        self.beats = True
        self.guards = True
        self.refuses: dict[tuple[int, int], int] = {}
        self.clips: dict[tuple[int, int], int] = {}
        self.loses = random.Random(0)
        self.loss = 0.0
        self.may_disturb = True
        self.asked: list[b.Request] = []

    def run(self, plan: b.BootPlan) -> b.BootOutcome:
        """Boot it up to the end."""
        machine = boot_up(plan)
        request = next(machine)
        while True:
            self.asked.append(request)
            assert len(self.asked) < 2000
            try:
                request = machine.send(self.answer(request))
            except StopIteration as end:
                return end.value

    def answer(self, request: b.Request) -> b.Answer:
        """Answer one request."""
        self.dead = self.dead or request == self.dies_at
        if isinstance(request, b.Local):
            return b.Got(self.may_disturb, 0.0)
        loss = (
            self.loss**3 if isinstance(request, b.Listen) else self.loss
        )  # one of three heartbeats is enough
        if self.dead or self.loses.random() < loss:
            return b.NoReply(request.deadline)
        match request:
            case b.Listen():
                heard = self.beats and self.objects.get((0x1017, 0))
                return b.Got(self.state, 0.1) if heard else b.NoReply(request.deadline)
            case b.GuardRequest():
                return b.Got(self.state, 0.01) if self.guards else b.NoReply(request.deadline)
            case b.BootNmtCommand():
                return self.obey(request.command)
            case b.Read():
                return self.read((request.index, request.subindex))
            case b.BootWrite():
                return self.write((request.index, request.subindex), request.value)
        raise AssertionError(request)

    def read(self, address: tuple[int, int]) -> b.Answer:
        if self.state is NmtState.STOPPED:
            return b.NoReply(0.5)
        if address in self.objects:
            return b.Got(self.objects[address], 0.002)
        return b.SdoAbortReply(MISSING, 0.002)

    def write(self, address: tuple[int, int], value: object) -> b.Answer:
        code = self.refuses.get(address, None if address in self.objects else MISSING)
        if code is not None:
            return b.SdoAbortReply(code, 0.002)
        self.objects[address] = self.clips.get(address, value)
        return b.Got(None, 0.002)

    def obey(self, command: NmtCommand) -> b.Answer:
        self.state = NmtState.OPERATIONAL if command is NmtCommand.START else NmtState.PRE_OPERATIONAL
        return b.Got(self.state, 0.01)

    def wrote(self) -> list[tuple[int, int, object]]:
        """The writes, in order, repetitions included."""
        return [
            (each.index, each.subindex, each.value) for each in self.asked if isinstance(each, b.BootWrite)
        ]

    def commands(self) -> list[NmtCommand]:
        return [each.command for each in self.asked if isinstance(each, b.BootNmtCommand)]


IDENTITY = {
    (0x1000, 0): b.Expected(402, 0xFFFF),
    (0x1018, 1): b.Expected(0x123),
    (0x1018, 2): b.Expected(0x456),
    (0x1018, 3): b.Expected(0x10002),
    (0x1018, 4): b.Expected(777),
}
SETTINGS = (b.Setting(0x6065, 0, 3000, "first"), b.Setting(0x6067, 0, 20, "second"))
