"""A finder on a wire in virtual time, with simulated modules and other devices; its frames are stored."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.discovery.finder import Finder, ProbeScope
from axisbus.drives.gim6010.discovery.results import DiscoveredModule, findings
from axisbus.drives.gim6010.sim.module import Module
from kit.sim.can_simple_module import Wire

LONGEST = 60.0  # s of virtual time
Strangers = Callable[[float], Sequence[tuple[int, bytes]]]


class Sent(NamedTuple):
    """A request of the finder, with its time."""

    time: float
    can_id: int
    data: bytes
    remote: bool


class Search:
    """Runs a finder to its end; holds its frames."""

    def __init__(
        self,
        modules: Sequence[Module],
        finder: Finder | None = None,
        *,
        strangers: Strangers = lambda _: (),
        answer: Callable[[Outgoing, float], Sequence[tuple[int, bytes]]] = lambda *_: (),
        at: Callable[[Search], None] = lambda _: None,
        since: float = 0.0,
    ) -> None:
        """``strangers`` gives the frames of others in each millisecond, ``answer`` their answers; ``at`` is called with the time.

        ``since``: the clock of modules that have run before.
        """
        self.wire = Wire(modules)
        self.wire.now = since
        self.finder = Finder() if finder is None else finder
        self.sent: list[Sent] = []
        self._taken = 0
        while not self.finder.done:
            assert self.wire.now < since + LONGEST
            self.wire.run(0.001)
            at(self)
            self._hear(strangers(self.wire.now))
            request = self.finder.step(self.wire.now)
            if request is not None:
                self.sent.append(Sent(self.wire.now, request.can_id, request.data, request.remote))
                self.wire.send(request.can_id, request.data, remote=request.remote)
                self._hear(answer(request, self.wire.now))

    @property
    def found(self) -> dict[tuple[str, int | None], DiscoveredModule]:
        """The findings, by protocol and node ID."""
        return {(each.protocol.value, each.node): each for each in findings(self.finder)}

    def _hear(self, others: Sequence[tuple[int, bytes]]) -> None:
        for frame in self.wire.heard[self._taken :]:
            self.finder.note(CanFrame(frame.time, frame.can_id, frame.data, frame.can_id > 0x7FF))
        self._taken = len(self.wire.heard)
        for can_id, data in others:
            self.finder.note(CanFrame(self.wire.now, can_id, data, can_id > 0x7FF))


def search(*modules: Module, ask: ProbeScope | None = None, remote: bool = True, **more: object) -> Search:
    """Find the modules of a wire; ``remote``: whether it carries remote frames."""
    return Search(modules, Finder(ask=ask, remote=remote), **more)  # type: ignore[arg-type]
