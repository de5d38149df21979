"""A drive that sends its statusword when the event timer runs out, and never else: boot shortens the timer, and moves arrive."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from unittest.mock import patch

import pytest

from axisbus.bus.pdo import eventtimer
from axisbus.errors import AxisbusError, SetPointError
from axisbus.sim.node.slave import Slave, TransmitState
from kit.scenarios.simulated_bus import Line, enable

SLOW_TIMER = 1500  # ms: longer than acknowledge_time
TYPE_255 = "[nodes.1.pdo.tpdo1]\ntransmission = 255\n"
# Time enough for everything but the handshake.
PATIENT = 'mode_time = "6s"\ntransition_time = "6s"'


def by_timer_alone(slave: Slave, now: float) -> None:
    """Send the event-driven TPDOs whose event timer has run out."""
    for pdo in slave._events:
        state = slave._sent.setdefault(pdo.number, TransmitState())
        if pdo.event_timer and now - state.stamp + 1e-9 >= pdo.event_timer:
            slave._send(pdo, state, pdo.pack(), now)


@pytest.fixture(autouse=True)
def timer_alone() -> Iterator[None]:
    with patch.object(Slave, "_send_events", by_timer_alone):
        yield


@pytest.fixture
def timer_kept() -> Iterator[None]:
    """The remedy taken out: every event timer stays as the drive has it."""
    with patch.object(eventtimer, "quicker", lambda timer, *_, **__: timer):
        yield


def slow(tmp_path) -> Line:
    line = Line(tmp_path, more=TYPE_255, axis=PATIENT)
    line.devices["x"].write(0x1800, 5, SLOW_TIMER)
    return line


def test_boot_shortens_the_timer_and_a_move_arrives(tmp_path):
    with slow(tmp_path) as line, line.open() as machine:
        assert "TPDO1 (statusword, mode, position) was 1500 ms, is now 20 ms" in machine.reports[0].text()
        assert line.devices["x"].read(0x1800, 5) == 20
        enable(machine["x"])
        machine["x"].move_absolute(10.0, velocity=200.0, acceleration=2000.0).wait(10)
        assert abs(line.where() - 10.0) < 0.5


def test_with_the_slow_timer_the_set_point_is_not_seen_to_be_taken(tmp_path, timer_kept):
    with slow(tmp_path) as line:
        machine = line.open()
        assert line.devices["x"].read(0x1800, 5) == SLOW_TIMER
        machine["x"].enable().wait(30)
        with pytest.raises(SetPointError, match="does not accept the set-point"):
            machine["x"].move_absolute(10.0, velocity=200.0, acceleration=2000.0).wait(10)
        with line.lock:
            line.devices["x"].write(0x1800, 5, 20)  # or it is as slow to show that it stops
        with suppress(AxisbusError):
            machine.close()
