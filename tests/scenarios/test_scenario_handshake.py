"""The set-point handshake with slow, deaf and odd drives: the axis ends at the last target, and the drive never takes an old one.

The oracle is the drive's own input: the target position at each rising edge of bit 4.
"""

from __future__ import annotations

import pytest

from axisbus.cia402.port import ValueTransport
from axisbus.errors import Replaced, SetPointError
from axisbus.sim.fault_injection import NEVER
from kit.cell import SCALE
from kit.plant_probe import ENABLED, OFF
from kit.setpoints import edges

PP = 1
PERIOD = 0.01
CYCLES = (0, 1, 5, 50)  # delays of the acknowledge
PORTS = {"target first": {}, "controlword first": {"controlword_first": True}}


def ready(scenario, delay: int, **changes):
    cell = scenario.simulated("x", **changes).enabled()
    cell.drive().dials.acknowledge_delay = delay * PERIOD
    return cell, edges(cell)


def settled(cell, target: float) -> bool:
    cell.run(0.6)
    return round(cell.where() * SCALE) == round(target * SCALE) and cell.speed() == 0.0


@pytest.mark.parametrize("delay", CYCLES)
@pytest.mark.parametrize("port", PORTS)
def test_a_move_arrives_for_any_delay_of_the_acknowledge(scenario, delay, port):
    cell, seen = ready(scenario, delay, port=PORTS[port])
    for target in (20.0, -3.0, 7.5):
        cell.x.move_absolute(target).wait(10)
        assert settled(cell, target)
    assert seen == [20.0, -3.0, 7.5]


@pytest.mark.parametrize("delay", CYCLES)
@pytest.mark.parametrize("port", PORTS)
def test_a_replacement_at_any_moment_of_the_handshake_ends_at_the_last_target(scenario, delay, port):
    cell, seen = ready(scenario, delay, port=PORTS[port])
    for offset in range(61):
        seen.clear()
        home, far, last = 0.0, 300.0, -2.0 - offset / 10
        first = cell.x.move_absolute(far)
        cell.run(offset * PERIOD) if offset else None
        second = cell.x.move_absolute(last)
        assert cell.end_of(second) is None, offset
        assert isinstance(cell.end_of(first), Replaced), offset
        assert settled(cell, last), (offset, cell.told())
        assert seen in ([far, last], [last]), offset
        cell.x.move_absolute(home, velocity=400.0).wait(10)


@pytest.mark.parametrize("delay", [1, 50])
def test_several_replacements_in_a_row_end_at_the_last(scenario, delay):
    cell, seen = ready(scenario, delay)
    targets = [50.0, -40.0, 30.0, -20.0, 10.0, 3.21]
    for target in targets[:-1]:
        cell.x.move_absolute(target)
        cell.run(0.03)
    cell.x.move_absolute(targets[-1]).wait(10)
    assert settled(cell, targets[-1])
    assert seen == [target for target in targets if target in seen]  # in order, none twice
    assert seen[-1] == 3.21


@pytest.mark.parametrize("delay", CYCLES)
@pytest.mark.parametrize("port", PORTS)
def test_a_halt_in_the_handshake_leaves_nothing_behind(scenario, delay, port):
    """The drive may acknowledge long after the halt; neither then nor with the next move may it go for the old target."""
    cell, seen = ready(scenario, delay, port=PORTS[port])
    for offset in (0, 1, 2, 3, 4, 5, 7, 10, 20, 40, 52, 60):
        seen.clear()
        start = cell.where()
        cell.x.move_absolute(start + 500.0)
        cell.run(offset * PERIOD) if offset else None
        cell.x.halt().wait(5)
        stood = cell.where()
        cell.run(0.8)
        assert abs(cell.where() - stood) < 0.1, offset
        target = round(stood) - 4.0
        cell.x.move_absolute(target).wait(10)
        assert settled(cell, target), offset
        assert cell.where() < stood + 0.1, offset
        assert seen[-1] == target
        # The old target, the position of the halt (until its 6062h is proven), and the new target.
        assert len(seen) <= (3 if offset < 10 else 2)


@pytest.mark.parametrize("delay", CYCLES)
def test_no_resumption_towards_the_old_target_while_a_new_one_is_offered(scenario, delay):
    cell, _ = ready(scenario, delay)
    cell.x.move_absolute(1000.0)
    cell.run(1.5)
    cell.x.halt().wait(3)
    stood = cell.where()
    farthest = 0.0
    move = cell.x.move_absolute(0.0)
    while move.busy:
        cell.run(PERIOD)
        farthest = max(farthest, cell.where() - stood)
    assert farthest < 0.1, f"it went on for {farthest:g} deg towards the target that the halt had ended"


@pytest.mark.parametrize("delay", CYCLES)
def test_a_quick_stop_in_the_handshake_leaves_nothing_behind(scenario, delay):
    cell, seen = ready(scenario, delay)
    for offset in (0, 2, 4, 6, 30):
        seen.clear()
        start = cell.where()
        cell.x.move_absolute(start + 500.0)
        cell.run(offset * PERIOD) if offset else None
        cell.x.quick_stop().wait(5)
        assert cell.stage() in OFF
        cell.x.enable().wait(5)
        stood = cell.where()
        cell.run(0.8)
        assert abs(cell.where() - stood) < 0.1, offset
        target = round(stood) - 4.0
        cell.x.move_absolute(target).wait(10)
        assert settled(cell, target), offset
        assert seen[-1] == target


@pytest.mark.nets("the stop sequence")
def test_a_set_point_that_is_never_acknowledged_stops_the_axis(scenario, golden):
    cell = scenario.simulated("x")
    cell.travelling()
    cell.drive().dials.acknowledge_delay = NEVER
    handle = cell.x.move_absolute(0.0)
    cell.run(1.0)
    cell.must_be_still(within=1.0, stages=ENABLED)
    refused = cell.failure_of(handle)
    assert isinstance(refused, SetPointError)
    golden("set_point_never_taken", refused)


@pytest.mark.nets("the stop sequence")
def test_an_acknowledge_that_never_falls_stops_the_axis(scenario, golden):
    cell = scenario.simulated("x").enabled()
    cell.drive().dials.acknowledge_stays = True
    handle = cell.x.move_absolute(2000.0)
    cell.run(1.0)
    cell.must_move()
    cell.must_be_still(within=1.0, stages=ENABLED)
    refused = cell.failure_of(handle)
    assert isinstance(refused, SetPointError)
    golden("acknowledge_stays", refused)


TRAVELS = {
    "with SYNC": {},
    "once per change": {
        "inputs": {"statusword": ValueTransport.EVENT_PDO},
        "max_age": {"statusword": float("inf")},
    },
    "by SDO": {"inputs": {"statusword": ValueTransport.SDO}, "max_age": {"statusword": 0.35}},
}


@pytest.mark.parametrize("travels", TRAVELS)
def test_moves_of_no_length_and_of_one_increment_end(scenario, travels):
    cell = scenario.simulated("x", port=TRAVELS[travels]).enabled()
    for target in (0.0, 0.01, 0.01, 0.0, 0.0, -0.01):
        cell.x.move_absolute(target).wait(3)
    assert settled(cell, -0.01)
    cell.x.move_relative(0.0).wait(3)
    assert settled(cell, -0.01)


@pytest.mark.parametrize("travels", TRAVELS)
def test_a_target_reached_that_falls_late_does_not_count_for_the_new_target(scenario, travels):
    cell = scenario.simulated("x", port=TRAVELS[travels]).enabled()
    cell.x.move_absolute(10.0).wait(5)
    cell.run(0.5)
    cell.drive().dials.target_reached_late = 0.2
    for target in (40.0, 10.0, 40.0):
        start = cell.now
        cell.x.move_absolute(target).wait(10)
        assert cell.now - start > 0.4  # 30 deg at 100 deg/s with 500 deg/s² take 0.5 s
        assert abs(cell.where() - target) < 0.02 * 30.0
        cell.run(0.5)


def test_a_move_without_target_reached_ends_by_the_deadline(scenario, golden):
    cell = scenario.simulated("x").enabled()
    cell.drive().dials.target_reached_never = True
    late = cell.failure_of(cell.x.move_absolute(10.0))
    golden("target_reached_never", late)
    assert settled(cell, 10.0)
