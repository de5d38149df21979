"""Values latched by a touch probe are transferred from a core in a process of its own, and its death ends the request."""

from __future__ import annotations

import os
import signal

import pytest

from axisbus.errors import ScanError
from axisbus.machine.machine import Machine
from kit.cell import SCALE
from kit.scenarios.core_process import OWN_PROCESS, own_cell

pytestmark = [OWN_PROCESS, pytest.mark.timeout(60)]


def test_captures_are_transferred_as_they_occur_and_a_killed_core_ends_the_request(tmp_path):
    machine = Machine.open(own_cell(tmp_path, "x"))
    try:
        x, drive = machine["x"], machine.simulated_node(1).drive()
        x.enable().wait(20)
        drive.touch_probe.put_mark(2, 10 * SCALE, 20 * SCALE)
        found = x.probe_move(30.0, input=2, velocity=60.0).wait(20)
        assert found.position == pytest.approx(10.0)
        x.halt().wait(20)
        with x.probe(continuous=True) as probe:
            probe.wait_armed(10)
            for _ in range(3):
                drive.touch_probe.set_input(1, True)
                edge = probe.next(10)
                assert (edge.edge, edge.missed) == ("rising", 0)
                assert edge.position == pytest.approx(x.position, abs=0.1)
                drive.touch_probe.set_input(1, False)
        last = x.probe().wait_armed(10)
        os.kill(machine._core.process, signal.SIGKILL)
        with pytest.raises(ScanError):
            last.wait(20)
    finally:
        with pytest.raises(ScanError):
            machine.close()
