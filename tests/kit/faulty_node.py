"""A node that sends given frames repeatedly."""

from __future__ import annotations

import itertools

import can

from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from kit import fuzz_frames as fuzz
from kit.sending_device import Talker

PAUSE = 0.001  # s between two frames


class MadNode(Talker):
    """Sends its frames repeatedly on a channel while its block lasts."""

    def __init__(self, channel: str, frames: list[can.Message], pause: float = PAUSE) -> None:
        super().__init__(channel)
        self.rounds = 0
        self._frames = frames
        self._pause = pause

    def _talk(self) -> None:
        for frame in itertools.cycle(self._frames):
            if self._over.wait(self._pause):
                return
            self._bus.send(frame)
            self.rounds += 1


def close(machine: Machine) -> list[BaseException]:
    """Close a machine; return the errors."""
    found: list[BaseException] = []
    with fuzz.within(30):
        try:
            machine.close()
        except* AxisbusError as errors:
            found += errors.exceptions
    return found
