"""A channel in virtual time for dialogues that sleep and wait: their clock runs the modules, and a kill may come at any frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace

import pytest

from axisbus.bus.gim6010 import can_simple_client, endpoints, node_id
from axisbus.sim.can_simple.module import Module
from kit.sim.module import Wire

_STEP = 0.001


class Killed(BaseException):
    """What ends a program without a word."""


class VirtualChannel:
    """Stands in for a ``Channel``; holds the wire, who listens, and how many frames were sent.

    ``killed_at``: the frame (counted from 0) before which the program is killed.
    """

    def __init__(self, modules: Sequence[Module], killed_at: int | None = None) -> None:
        self.wire = Wire(modules)
        self.sent: list[tuple[int, bytes]] = []
        self.killed_at = killed_at
        self._ears: dict[int, list[Callable[[bytes, float], None]]] = {}
        self._taken = 0

    def subscribe(self, can_id, receiver):
        self._ears.setdefault(can_id, []).append(receiver)

    def unsubscribe(self, can_id, receiver):
        self._ears[can_id].remove(receiver)

    def send(self, can_id, data):
        self._send(can_id, data, remote=False)

    def send_remote(self, can_id, length=0):
        self._send(can_id, b"", remote=True)

    def check(self):
        """It does not fail."""

    def _send(self, can_id, data, *, remote):
        if len(self.sent) == self.killed_at:
            raise Killed
        self.sent.append((can_id, bytes(data)))
        self.wire.send(can_id, data, remote=remote)
        self._deliver()

    # The clock.

    def monotonic(self):
        return self.wire.now

    def sleep(self, seconds):
        for _ in range(max(1, round(seconds / _STEP))):
            self.wire.run(_STEP, _STEP)
            self._deliver()

    def wait_for(self, there, seconds):
        end = self.wire.now + seconds
        while not there() and self.wire.now < end:
            self.sleep(_STEP)
        return there()

    def _deliver(self):
        for frame in self.wire.heard[self._taken :]:
            for ear in tuple(self._ears.get(frame.can_id, ())):
                ear(frame.data, frame.time)
        self._taken = len(self.wire.heard)


def virtual_channel(
    monkeypatch: pytest.MonkeyPatch, *modules: Module, killed_at: int | None = None
) -> VirtualChannel:
    """Let all dialogues with modules of CAN Simple live in the time of a channel, and return that."""
    channel = VirtualChannel(modules, killed_at)
    clock = SimpleNamespace(monotonic=channel.monotonic, sleep=channel.sleep)
    for module in (endpoints, node_id, can_simple_client):
        monkeypatch.setattr(module, "time", clock)
    monkeypatch.setattr(can_simple_client, "require_other_thread", lambda *_: None)
    monkeypatch.setattr(
        can_simple_client.SimpleLine, "wait", lambda _, there, seconds: channel.wait_for(there, seconds)
    )
    return channel
