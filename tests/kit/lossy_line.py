"""A wire that loses frames at random, between two channels of python-can's virtual bus."""

from __future__ import annotations

import random
import threading
from types import TracebackType

import can


class LossyLine:
    """Carries every frame from one channel to the other, except each with the probability ``loss``; counts both."""

    def __init__(self, one: str, other: str, loss: float, seed: int) -> None:
        self.carried = 0
        self.lost = 0
        self._loss = loss
        self._random = random.Random(seed)
        self._ends = [can.Bus(interface="virtual", channel=name) for name in (one, other)]
        self._stop = threading.Event()
        self._threads = [
            threading.Thread(target=self._carry, args=pair, daemon=True)
            for pair in (self._ends, self._ends[::-1])
        ]

    def __enter__(self) -> LossyLine:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()
        for end in self._ends:
            end.shutdown()

    def _carry(self, source: can.BusABC, target: can.BusABC) -> None:
        while not self._stop.is_set():
            message = source.recv(0.1)
            if message is None:
                continue
            if self._random.random() < self._loss:
                self.lost += 1
            else:
                self.carried += 1
                target.send(message)
