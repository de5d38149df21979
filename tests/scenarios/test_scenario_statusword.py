"""How the statusword travels: with SYNC, on change, by SDO; that moves work, and that its silence is noticed in time."""

from __future__ import annotations

import math

import pytest

from axisbus.cia402.port import ValueTransport
from axisbus.errors import StaleError
from kit.plant_probe import ENABLED, OFF

EVENT = ValueTransport.EVENT_PDO
# How the inputs of a drive may travel. Without an event timer silence says nothing: the bus then polls 6041h and 6064h by SDO.
TRAVELS = {
    "with SYNC": {},
    "on change, with an event timer": {
        "inputs": {"statusword": EVENT, "position": EVENT, "mode": EVENT},
        "event_timer": 0.02,
    },
    "on change only, position with SYNC": {
        "inputs": {"statusword": EVENT},
        "max_age": {"statusword": math.inf},
    },
    "by SDO": {
        "inputs": {
            "statusword": ValueTransport.SDO,
            "position": ValueTransport.SDO,
            "mode": ValueTransport.SDO,
        },
        "max_age": {"statusword": 0.35, "position": 0.35},
    },
    "by SDO, without a position": {
        "inputs": {
            "statusword": ValueTransport.SDO,
            "position": ValueTransport.NONE,
            "demand": ValueTransport.NONE,
            "velocity": ValueTransport.NONE,
        },
        "max_age": {"statusword": 0.35},
    },
    "with SYNC, the mode by SDO": {
        "inputs": {"mode": ValueTransport.SDO},
        "outputs": {"mode": ValueTransport.SDO},
    },
    "everything event-driven": {
        "inputs": dict.fromkeys(("statusword", "mode", "position", "velocity", "torque", "demand"), EVENT),
        "outputs": dict.fromkeys(
            ("controlword", "mode", "target_position", "target_velocity", "target_torque"), EVENT
        ),
        "event_timer": 0.02,
    },
}
SEEN = [name for name in TRAVELS if "without" not in name]


@pytest.mark.parametrize("travels", SEEN)
def test_moves_arrive_for_every_transport_of_the_statusword(scenario, travels):
    cell = scenario.simulated("x", port=TRAVELS[travels]).enabled()
    for target in (30.0, -5.0, -5.0, -4.99):
        cell.x.move_absolute(target).wait(10)
        cell.run(0.4)
        assert abs(cell.where() - target) < 0.02, travels
    cell.x.home().wait(5)
    cell.x.move_velocity(40.0).wait(5)
    cell.run(0.5)
    cell.must_move(faster_than=38.0)
    cell.x.halt().wait(3)
    cell.run(0.3)
    assert cell.speed() == 0
    cell.x.disable().wait(5)
    assert cell.stage() in OFF


@pytest.mark.parametrize("travels", TRAVELS)
@pytest.mark.nets("the stop sequence")
def test_a_turning_axis_is_stopped_for_every_transport_of_the_statusword(scenario, travels):
    port = TRAVELS[travels]
    if "without" in travels:  # a drive that cannot say where it is can still be turned and stopped
        cell = scenario.simulated("x").enabled()
        cell.x.move_velocity(50.0).wait(3)
        cell.hold_back("position", "velocity", "demand")
    else:
        cell = scenario.simulated("x", port=port)
        cell.turning(50.0)
    stop = cell.x.stop()
    cell.must_be_still(within=2.5, stages=(ENABLED, *OFF))
    cell.end_of(stop)


@pytest.mark.parametrize(
    ("name", "port"),
    [
        ("sync", {}),
        ("event_timer", TRAVELS["on change, with an event timer"]),
        ("sdo", TRAVELS["by SDO"]),
    ],
)
@pytest.mark.nets("the stop sequence")
def test_a_statusword_that_becomes_stale_during_a_move_causes_a_quick_stop(scenario, golden, name, port):
    cell = scenario.simulated("x", port=port)
    (handle,) = cell.travelling()
    cell.hold_back("statusword")  # the drive sends everything but that
    cell.must_be_still(within=1.5, stages=OFF)
    stale = cell.failure_of(handle)
    assert isinstance(stale, StaleError)
    golden(f"statusword_stale_{name}", stale)


def test_a_stale_value_raises_an_error(scenario, golden):
    cell = scenario.simulated("x")
    cell.run(0.2)
    cell.device().dials.tpdos_stop = frozenset({1, 2, 3, 4})
    cell.run(0.3)
    with pytest.raises(StaleError) as caught:
        _ = cell.x.position
    golden("position_stale", caught.value)
    with pytest.raises(StaleError):
        _ = cell.x.velocity


def test_enabling_without_a_statusword_reports_so(scenario, golden):
    cell = scenario.simulated("x")
    cell.hold_back("statusword")
    cell.run(0.3)
    failed = cell.failure_of(cell.x.enable())
    golden("enable_without_statusword", failed)
    assert cell.stage() in OFF


@pytest.mark.nets("the stop sequence")
def test_a_frozen_statusword_does_not_prevent_a_stop(scenario):
    """The drive's firmware hangs partly: it keeps sending its last statusword."""
    cell = scenario.simulated("x")
    cell.turning()
    cell.drive().dials.statusword_frozen = True
    stop = cell.x.disable()
    cell.must_be_still(within=1.0, stages=(ENABLED, *OFF))
    cell.end_of(stop)
    cell.run(0.2)
    assert cell.stage() in OFF
