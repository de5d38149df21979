"""A loop of the program's own in real time, wherever the core runs: it answers in time, and an axis stops where it does not."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from axisbus import AxisFeedback, AxisState, Machine
from axisbus.errors import CommandError

LATE = 125  # cycles: half a second, which a busy computer does not take
CELL = Path(__file__).parents[2] / "examples" / "cell.toml"


def loop_that(late: list[bool]):
    """A loop that returns 60 deg/s, and is late once for each item of ``late``."""

    def loop(_: AxisFeedback) -> float:
        if late and late.pop():
            time.sleep(1.5)
        return 60.0

    return loop


def test_a_late_answer_stops_the_axis_and_the_next_loop_is_in_time():
    with Machine.open(CELL) as cell:
        x, late = cell["x"], list[bool]()
        x.enable().wait(5)
        controller = x.controller(loop_that(late), max_missed_cycles=LATE)
        cell.sleep(0.8)
        assert controller.handle.busy
        assert x.velocity > 30.0
        late.append(True)
        with pytest.raises(CommandError, match="answered too late"):
            controller.handle.wait(4)
        cell.sleep(1.5)  # until the function has returned
        assert abs(x.velocity) < 1.0
        assert x.state is AxisState.ERRORSTOP
        assert controller.lateness.worst > 1.0
        x.reset().wait(2)
        with x.controller(loop_that([]), max_missed_cycles=LATE) as controller:
            cell.sleep(0.5)
        assert controller.lateness.cycles > 20
        assert x.state is AxisState.STANDSTILL
