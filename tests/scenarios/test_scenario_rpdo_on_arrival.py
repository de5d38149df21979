"""A bus without SYNC: RPDOs go out on change, again for a drive that lost one, and in time for a drive that watches for them."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from contextlib import suppress
from unittest.mock import patch

import pytest

from axisbus.bus.pdo import rpdo
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from kit.plant_probe import ENABLED, QUICK_STOP, SWITCH_ON_DISABLED
from kit.scenarios.other_master import Ear
from kit.scenarios.simulated_bus import Line, enable, until

RPDO1 = 0x201
RPDO_LATE = 0x8250
# The drive watches for RPDO1 (14xxh:05), and faults where it stays away.
WATCHED = '[nodes.1.objects]\n"6007" = 1\n[nodes.1.pdo.rpdo1]\nmap = ["6060", "607A", "6040"]\nevent_timer = "{time}"\n'


@pytest.fixture
def no_repetition() -> Iterator[None]:
    """The remedies taken out: an RPDO is sent when it changes, and never else."""
    with patch.object(rpdo.RpdoPace, "_is_due", lambda *_: False):
        yield


# The controlword that is lost, by its bits: quick stop is active low.
LOST = {
    "the edge of a set-point": lambda word: word & 0x1F == 0x1F,
    "a quick stop": lambda word: word & 0x06 == 0x02,
}


class Loss:
    """Loses the first frame of RPDO1 with a certain controlword before the drive receives it; ``lost`` holds it."""

    def __init__(self, line: Line, what: str) -> None:
        self.lost: list[bytes] = []
        self._is_it = LOST[what]
        slave = line.simulated_nodes.nodes[0].slave
        self._slave, self._take = slave, slave._on_rpdo
        slave._on_rpdo = self._on_rpdo

    def _on_rpdo(self, pdo, data: bytes, now: float) -> None:
        if not self.lost and self._is_it(struct.unpack("<H", data[:2])[0]):
            self.lost.append(data)
        else:
            self._take(pdo, data, now)


def opened(line: Line) -> Machine:
    machine = line.open()
    enable(machine["x"])
    return machine


def test_an_axis_at_standstill_needs_ten_frames_a_second(tmp_path):
    with Line(tmp_path, bus="sync = false") as line, opened(line) as machine, Ear(line.channel) as ear:
        time.sleep(0.3)
        ear.take()
        ear.heard.clear()
        began, cycles = time.monotonic(), machine._core.scan.lateness.cycles
        time.sleep(2.0)
        ear.take()
        seconds, cycles = time.monotonic() - began, machine._core.scan.lateness.cycles - cycles
        frames = [message for message in ear.heard if message.arbitration_id == RPDO1]
        # 0.1 s is the longest time between two: with scans of 20 ms every fifth cycle, never more often than every fourth
        assert 2 <= len(frames) <= cycles / 4 + 2
        assert len(frames) >= 0.4 * min(cycles / 5, seconds / 0.1)
        assert len({bytes(message.data) for message in frames}) == 1


def test_moves_and_turning_arrive_on_a_bus_without_sync(tmp_path):
    with Line(tmp_path, bus="sync = false") as line, opened(line) as machine:
        axis = machine["x"]
        for target in (10.0, -4.0):
            axis.move_absolute(target, velocity=200.0, acceleration=2000.0).wait(10)
            assert abs(line.where() - target) < 0.5
        axis.move_velocity(50.0).wait(10)
        line.must_move("x")
        axis.halt().wait(10)
        assert line.speed() == 0.0


@pytest.mark.parametrize("what", ["the edge of a set-point", "a quick stop"])
def test_a_frame_that_the_drive_loses_is_made_good(tmp_path, what):
    with Line(tmp_path, bus="sync = false") as line, opened(line) as machine:
        loss = Loss(line, what)
        _lose(machine, loss, what)
        until(lambda: _obeyed(line, what), 0.4)


def test_without_a_repetition_a_set_point_is_lost_for_good(tmp_path, no_repetition):
    what = "the edge of a set-point"
    with Line(tmp_path, bus="sync = false") as line:
        machine = opened(line)
        loss = Loss(line, what)
        _lose(machine, loss, what)
        time.sleep(0.4)
        assert not _obeyed(line, what)
        with suppress(AxisbusError):
            machine.close()


def test_a_quick_stop_whose_frame_is_lost_is_sent_by_sdo(tmp_path, no_repetition):
    what = "a quick stop"
    with Line(tmp_path, bus="sync = false") as line:
        machine = opened(line)
        loss = Loss(line, what)
        _lose(machine, loss, what)
        until(lambda: _obeyed(line, what), 0.4)
        machine.close()


def _lose(machine: Machine, loss: Loss, what: str) -> None:
    if what == "a quick stop":
        machine["x"].quick_stop()
    else:
        machine["x"].move_absolute(300.0, velocity=100.0)
    until(lambda: loss.lost, 2.0)


def _obeyed(line: Line, what: str) -> bool:
    if what == "a quick stop":
        return line.stage() in (QUICK_STOP, SWITCH_ON_DISABLED)
    return line.speed() > 0.0


@pytest.mark.parametrize("deadline", ["150ms", "400ms"])
def test_a_drive_that_watches_for_its_rpdo_stays_content(tmp_path, deadline):
    more = WATCHED.format(time=deadline)
    with Line(tmp_path, bus="sync = false", more=more) as line, opened(line) as machine:
        assert line.devices["x"].read(0x1400, 5) == int(deadline[:-2])
        time.sleep(2.0)
        assert line.drive().error_code == 0
        assert line.stage() == ENABLED, machine["x"].error
        machine["x"].move_absolute(5.0).wait(10)


def test_without_a_repetition_the_drive_that_watches_faults(tmp_path, no_repetition):
    with Line(tmp_path, bus="sync = false", more=WATCHED.format(time="150ms")) as line:
        machine = line.open()
        with pytest.raises(AxisbusError):
            machine["x"].enable().wait(10)
            time.sleep(1.0)
            machine["x"].move_absolute(5.0).wait(10)
        assert line.drive().error_code == RPDO_LATE
        with suppress(AxisbusError):
            machine.close()
