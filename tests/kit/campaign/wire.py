"""Frames of one axis that are lost, or come late, in both directions; and another master on the same bus."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Mapping

from axisbus.cia301.nmt import NmtCommand
from axisbus.cia402.port import INPUT_OBJECTS, Inputs, Sample
from axisbus.sim.direct import DirectPort
from kit.cell import Cell

_FIELDS = tuple(INPUT_OBJECTS)


class Wire:
    """What lies between a port and its drive; holds the frames that are under way. Its fields are dials.

    ``inputs_lost``, ``outputs_lost``: the share of frames that never arrive. ``late``: cycles by which both come later.
    """

    def __init__(self, port: DirectPort, seed: int, period: float) -> None:
        self.inputs_lost = self.outputs_lost = 0.0
        self.late = 0
        self._chance = random.Random(seed)
        self._period = period
        self._port = port
        self._in: deque[Inputs] = deque()
        self._out: deque[dict[str, int]] = deque()
        self._sample, self._latch, self._read = port.sample, port.latch, port.read
        port.sample, port.latch, port.read = self.sample, self.latch, self.read  # type: ignore[method-assign]

    def sample(self, now: float) -> None:
        """The drive's synchronous frame: it arrives, or not."""
        if not self.inputs_lost or self._chance.random() >= self.inputs_lost:
            self._sample(now)

    def latch(self) -> None:
        """Our synchronous frame: it arrives now, some cycles later, or not."""
        frame = self._port._latched
        if self.outputs_lost and frame and self._chance.random() < self.outputs_lost:
            frame = {}
        self._out.append(frame)
        self._port._latched = {}
        while len(self._out) > self.late:
            self._port._latched = self._out.popleft()
            self._latch()

    def read(self, now: float) -> Inputs:
        """What the master reads: the values of some cycles ago, which have only just come."""
        self._in.append(self._read(now))
        while len(self._in) > self.late + 1:
            self._in.popleft()
        newest, shown = self._in[-1], self._in[0]
        if newest is shown:
            return newest
        delay = newest.now - shown.now
        values = {name: _later(getattr(shown, name), delay) for name in _FIELDS}
        return newest._replace(**values)


def _later(sample: Sample | None, delay: float) -> Sample | None:
    return None if sample is None else Sample(sample.value, sample.stamp + delay)


# -- another master: what it does to a drive ------------------------------------------------------------------------------


def _words(cell: Cell, name: str, *words: int) -> None:
    drive = cell.drive(name)
    for word in words:
        drive.controlword = word
        drive.hear()


def _set_point(cell: Cell, name: str, value: float) -> None:
    drive = cell.drive(name)
    drive.target_position = drive.position + round(200.0 * value * cell.scale_of(name))
    _words(cell, name, 0x0F, 0x3F)


def _velocity(cell: Cell, name: str, value: float) -> None:
    drive = cell.drive(name)
    drive.mode, drive.target_velocity = 3, round(60.0 * value * cell.scale_of(name))


OTHER_MASTER: Mapping[str, Callable[[Cell, str, float], object]] = {
    "other_shuts_down": lambda cell, name, _: _words(cell, name, 0x06),
    "other_quick_stops": lambda cell, name, _: _words(cell, name, 0x0B),
    "other_enables": lambda cell, name, _: _words(cell, name, 0x06, 0x07, 0x0F),
    "other_sets_point": _set_point,
    "other_takes_velocity": _velocity,
    "other_stops_node": lambda cell, name, _: cell.device(name).nmt_command(NmtCommand.STOP),
    "reboots": lambda cell, name, _: cell.device(name).nmt_command(NmtCommand.RESET_NODE),
}
