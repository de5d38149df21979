"""Slow SDO polling of the inputs without a PDO, through the node's worker."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from axisbus.bus.sdo.worker import SdoJob, SdoWorker
from axisbus.cia402.port import INPUT_OBJECTS, Sample


class Poller:
    """Polls some inputs; holds state: the due time of each, the running requests, and the newest answers.

    A polled value counts only if no PDO has brought a value of this input since the poll began: a newer TPDO may have overtaken the
    answer in the drive. The value has the time of its request, because it was sampled after that.
    """

    def __init__(
        self,
        worker: SdoWorker,
        periods: Mapping[str, float],
        index_of: Callable[[int], int],
    ) -> None:
        """``periods`` in seconds by the input's name; ``index_of`` converts a first-axis index into the axis's."""
        self._worker = worker
        self._periods = dict(periods)
        self._index_of = index_of
        self._due = dict.fromkeys(periods, float("-inf"))
        self._under_way: set[str] = set()
        self._answers: dict[str, tuple[Sample, float]] = {}

    def poll(self, now: float) -> None:
        """Request the inputs that are due; does not block."""
        for name, period in self._periods.items():
            if now >= self._due[name] and name not in self._under_way:
                self._due[name] = now + period
                self._under_way.add(name)
                self._worker.submit(self._job(name))

    def read_into(self, samples: dict[str, Sample]) -> None:
        """Put the received answers into ``samples``."""
        for name in tuple(self._answers):
            sample, began = self._answers.pop(name)
            known = samples.get(name)
            if known is None or known.stamp <= began:
                samples[name] = sample

    def _job(self, name: str) -> SdoJob:
        began = time.monotonic()

        def done(value: int | None, abort: int | None) -> None:
            if abort is None and value is not None:
                self._answers[name] = Sample(value, self._worker.began), began
            self._under_way.discard(name)

        return SdoJob((self, name), self._index_of(INPUT_OBJECTS[name]), 0, None, done)
