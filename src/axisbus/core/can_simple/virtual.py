"""Simulated modules in virtual time, beside stand-ins without a bus: their frames, and the cycle that lets time pass.

Theory of operation
-------------------
What a master has of a module is frames, also here: the line hands those of the master to the modules and back, each at the virtual
time at which it is sent. Whoever boots a module lets time pass by ``sleep``, before the scan begins; then the cycle does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from axisbus.cia301.frame import CanFrame
from axisbus.core.can_simple.module_port import ModuleSender
from axisbus.errors import BusError
from axisbus.sim.can_simple.module import Module
from axisbus.sim.direct import DirectCycle

_STEP = 0.005  # s: answers and heartbeats come as often, and no plant is stepped more often than it has to be
Ear = Callable[[CanFrame], None]
Receiver = Callable[[bytes, float], None]


class VirtualLine:
    """What leads to the modules, as a ``Channel`` does on a bus; holds who hears, and the time up to which all is told."""

    name = "virtual time"
    offs = 0  # it is never off
    off: BusError | None = None
    last_off: BusError | None = None

    def __init__(self, modules: Mapping[int, Module]) -> None:
        self._modules = dict(modules)
        self._receivers: dict[int, list[Receiver]] = {}
        self._ears: list[Ear] = []
        self.now = 0.0

    def subscribe(self, can_id: int, receiver: Receiver) -> None:
        """Have ``receiver(data, stamp)`` called for each frame of a module with this identifier."""
        self._receivers.setdefault(can_id, []).append(receiver)

    def unsubscribe(self, can_id: int, receiver: Receiver) -> None:
        """End that."""
        self._receivers[can_id] = [each for each in self._receivers.get(can_id, ()) if each != receiver]

    @contextmanager
    def overheard(self, ear: Ear) -> Iterator[None]:
        """Have ``ear`` called for every frame of a module within the block."""
        self._ears.append(ear)
        try:
            yield
        finally:
            self._ears.remove(ear)

    def send(self, can_id: int, data: bytes) -> None:
        """Send a data frame to the modules; what they answer at once comes at once."""
        self._give(can_id, data, remote=False)

    def send_remote(self, can_id: int, length: int = 0) -> None:  # noqa: ARG002
        """Send a remote frame."""
        self._give(can_id, b"", remote=True)

    def check(self) -> None:
        """Nothing can be wrong with it."""

    def health(self) -> str:
        """Say that nothing is."""
        return ""

    def pass_time(self, now: float) -> None:
        """Let the modules live until ``now`` (s), and tell what they have sent."""
        self.now = now
        for module in self._modules.values():
            module.step(now)
            self._tell(module)

    def _give(self, can_id: int, data: bytes, *, remote: bool) -> None:
        for module in self._modules.values():
            module.on_frame(can_id, data, self.now, remote=remote)
            self._tell(module)

    def _tell(self, module: Module) -> None:
        for can_id, data in module.take_frames():
            for ear in self._ears:
                ear(CanFrame(self.now, can_id, bytes(data), can_id > 0x7FF))
            for receiver in self._receivers.get(can_id, ()):
                receiver(bytes(data), self.now)


class MixedCycle(DirectCycle):
    """Stand-ins and modules in one virtual time; ``senders`` are those of the modules that have come up."""

    def __init__(self, line: VirtualLine, *given: Any, **options: Any) -> None:
        """``given`` and ``options`` as those of ``DirectCycle``."""
        self.line = line
        self.senders: Sequence[ModuleSender] = ()
        super().__init__(*given, **options)

    def sleep(self, seconds: float) -> None:
        """Let time pass, before there is a scan."""
        self._advance(self.now() + seconds)

    def commit(self) -> None:
        """As ``DirectCycle.commit``."""
        super().commit()
        for sender in self.senders:
            for can_id, data in sender.take_frames():
                self.line.send(can_id, data)
            for can_id, length in sender.take_requests(self.now()):
                self.line.send_remote(can_id, length)

    def quick_stop_all(self) -> bool:
        """As ``DirectCycle.quick_stop_all``."""
        for sender in self.senders:
            for can_id, data in sender.stop_frames()[0]:
                self.line.send(can_id, data)
        return super().quick_stop_all()

    def _advance(self, t: float) -> None:
        while t - self.now() > 1e-12:
            super()._advance(min(t, self.now() + _STEP))
            self.line.pass_time(self.now())
