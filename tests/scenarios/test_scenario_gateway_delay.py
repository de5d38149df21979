"""Frames that come ever later over a gateway, none of them lost: the axis stops before its values are older than they may be."""

from __future__ import annotations

import time
from collections import deque
from contextlib import suppress

import can
import pytest

from axisbus.errors import AxisbusError, StaleError
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.plant_probe import OFF
from kit.scenarios.simulated_bus import Line, turning, until


class Gateway:
    """A gateway between the adapter of a machine and the bus; each second delays received frames by ``rate`` seconds more."""

    def __init__(self, machine: Machine) -> None:
        self._bus = machine._core.scan.cycle._channel.bus
        self._recv = self._bus.recv
        self._queue: deque[tuple[float, can.Message]] = deque()
        self._since, self.rate, self.most = time.monotonic(), 0.0, 0.6
        self._bus.recv = self._on_recv

    def slow_down(self, rate: float) -> None:
        self._since, self.rate = time.monotonic(), rate

    @property
    def delay(self) -> float:
        return min(self.most, self.rate * (time.monotonic() - self._since))

    def _on_recv(self, timeout: float | None = None) -> can.Message | None:
        if self._queue and self._queue[0][0] <= time.monotonic():
            return self._queue.popleft()[1]
        message = self._recv(min(timeout or 0.0, 0.001) if self._queue else timeout)
        if message is None or not self.rate:
            return message
        self._queue.append((time.monotonic() + self.delay, message))
        return None


@pytest.mark.parametrize("rate", [0.1, 0.4])
def test_an_axis_is_stopped_when_its_process_data_arrive_ever_later(tmp_path, rate):
    with Line(tmp_path, "x", period="10ms", heartbeat="400ms") as line:
        machine = line.open()
        try:
            gateway = Gateway(machine)
            turning(machine, line)
            x = machine["x"]
            handle = x.move_relative(1e5, velocity=90.0)
            until(lambda: line.speed() > 80.0)
            gateway.slow_down(rate)
            until(lambda: not handle.busy)
            reached = gateway.delay
            gateway.rate = 0.0
            assert isinstance(handle.exception(), StaleError)
            assert reached < 0.1 + rate * 1.0 + 0.1  # the maximum age, the grace, and a busy computer
            until(lambda: x.state is AxisState.ERRORSTOP)
            line.must_be_still(stages=OFF)
        finally:
            with suppress(
                AxisbusError, ExceptionGroup
            ):  # its standstill was not seen while its values were unknown
                machine.close()
