"""A stream of a core in a process of its own is interrupted and resumed: no point is left out, none is used twice."""

from __future__ import annotations

import time
from itertools import pairwise

import pytest

from axisbus.errors import Interrupted
from axisbus.machine.machine import Machine
from kit.cell import SCALE
from kit.scenarios.core_process import OWN_PROCESS, own_cell

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]


def test_a_stream_is_halted_and_resumed_repeatedly(tmp_path, core_in_threads):
    with Machine.open(own_cell(tmp_path, "xy", axis="max_acceleration = 2000.0")) as machine:
        group, drive = machine.group("x", "y"), machine.simulated_node(1).drive()
        group.enable().wait(20)
        points = group.stream(period="20ms", buffer="400ms")
        seen = []

        def feed(seconds):
            until = time.monotonic() + seconds
            while time.monotonic() < until:
                points.push((0.8 * points.count, -0.4 * points.count))
                seen.append(drive.axis.motor.position / SCALE)

        for _ in range(4):
            feed(1.0)
            group.halt().wait(20)
            with pytest.raises(Interrupted):
                feed(1.0)
            points.resume()
        feed(0.5)
        last = 0.8 * (points.count - 1)
        points.finish().wait(30)
        assert machine["x"].position == pytest.approx(last, abs=0.1)
        assert machine["y"].position == pytest.approx(-0.5 * last, abs=0.1)
        assert max(a - b for a, b in pairwise(seen)) < 0.05  # never back
