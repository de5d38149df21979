"""A dialogue with simulated modules on a wire in virtual time, with lost frames and events meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from axisbus.cia301.frame import CanFrame
from kit.sim.can_simple_module import Wire


class Sent(NamedTuple):
    """A frame of the dialogue, with its time."""

    time: float
    can_id: int
    data: bytes
    remote: bool

    @property
    def command(self) -> int:
        return self.can_id & 0x1F


def play(
    dialogue,
    wire: Wire,
    *,
    at: Callable[[Wire], None] = lambda _: None,
    lose: Callable[[str, int, float], bool] = lambda *_: False,
    longest: float = 400.0,
    step: float = 0.001,
) -> list[Sent]:
    """Run it to its end and return its frames; ``lose(side, command, time)`` selects frames that are lost."""
    sent: list[Sent] = []
    taken = len(wire.heard)
    while not dialogue.done:
        assert wire.now < longest, "it does not end"
        wire.run(step, step)
        at(wire)
        for frame in wire.heard[taken:]:
            if not lose("module", frame.command, frame.time):
                dialogue.note(CanFrame(frame.time, frame.can_id, frame.data, frame.can_id > 0x7FF))
        taken = len(wire.heard)
        request = dialogue.step(wire.now)
        if request is not None:
            sent.append(Sent(wire.now, request.can_id, request.data, request.remote))
            if not lose("master", request.can_id & 0x1F, wire.now):
                wire.send(request.can_id, request.data, remote=request.remote)
    return sent
