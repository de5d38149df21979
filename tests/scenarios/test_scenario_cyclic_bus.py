"""Cyclic velocity and torque over a bus in real time: the mapping beside the targets."""

from __future__ import annotations

import pytest

from axisbus.errors import StateError
from kit.cell import Stage
from kit.plant_probe import ENABLED, OFF

RAMP = 500.0  # deg/s²
# The clock of a simulated drive and that of the bus differ: a cycle may take a little more or less than its time.
JOLT = 2.0 * RAMP
OFFSETS = """
[nodes.1.pdo.rpdo1]
map = ["6060", "607A", "6040"]
[nodes.1.pdo.rpdo2]
map = ["60FF", "60B1"]
[nodes.1.pdo.rpdo3]
map = ["6071", "60B2"]
"""


@pytest.mark.parametrize("more", ["", OFFSETS], ids=["the master's own layout", "offsets beside the targets"])
def test_targets_travel_with_each_sync_and_offsets_stay_0(scenario: Stage, more: str) -> None:
    cell = scenario.real("x", axis="rated_torque = 10.0", more=more)
    cell.device().write(0x60B1, 0, 3000)  # another program's
    cell.device().write(0x60B2, 0, 200)
    cell.enabled()
    moment = cell.moment()
    cell.x.cyclic_velocity(100.0).wait(5)
    cell.run(0.3)
    assert cell.sample().velocity == pytest.approx(100.0, rel=0.02)
    cell.x.cyclic_velocity(-50.0).wait(5)
    cell.x.halt().wait(5)
    cell.must_be_still(within=0.5, stages=ENABLED)
    assert cell.hardest_change(since=moment) <= JOLT
    cell.x.cyclic_torque(0.3, slope=2.0).wait(5)
    cell.run(0.2)
    assert cell.torque() == pytest.approx(30.0, abs=1.0)
    cell.x.halt().wait(5)
    assert (cell.device().read(0x60B1), cell.device().read(0x60B2)) == (0, 0)


def test_the_end_of_the_block_ramps_the_axis_down(scenario: Stage) -> None:
    cell = scenario.real("x").enabled()
    cell.x.cyclic_velocity(100.0).wait(5)
    start, moment = cell.where(), cell.moment()
    with cell.machine:
        pass
    assert cell.stage() in OFF
    cell.must_have_moved("x", start, (9.0, 20.0))
    assert cell.hardest_change(since=moment) <= JOLT


def test_a_bus_without_sync_refuses_both(scenario: Stage) -> None:
    cell = scenario.real("x", axis="rated_torque = 10.0", bus="sync = false").enabled()
    for handle in (cell.x.cyclic_velocity(10.0), cell.x.cyclic_torque(0.1, slope=1.0)):
        error = cell.failure_of(handle)
        assert isinstance(error, StateError)
        assert "in synchronous PDOs" in error.message
    assert cell.top_speed() == 0.0
