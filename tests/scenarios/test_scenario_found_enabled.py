"""A drive found enabled at boot: reported, left alone, taken over without a jump, and left again as it was found."""

from __future__ import annotations

import pytest

from axisbus import eds
from axisbus.cia301.nmt import NmtState
from axisbus.eds.builtin import resolve
from axisbus.errors import StateError
from axisbus.motion.states import AxisState
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from kit.plant_probe import ENABLED, SWITCH_ON_DISABLED, SWITCHED_ON

GENERIC = "builtin:generic-cia402"
PP, PV, CSP = 1, 3, 8
TURNING = 5000  # velocity increments: 50 deg/s


def found(stage, mode: int, **drive: int):
    """A node whose drive another master has left enabled in ``mode``, with these targets."""

    def make() -> dict[int, Device]:
        device = device_from_eds(eds.load(resolve(GENERIC, stage.folder)), 1)
        device.power_on()
        device.write(0x6083, 0, 50_000)
        device.write(0x6084, 0, 50_000)
        for name, value in drive.items():
            setattr(device.drives[0], name, value)
        device.drives[0].start_enabled(mode)
        device.step(0.5)
        return {1: device}

    return make


def at_rest(stage):
    return stage.simulated("x", devices=found(stage, PP))


def turning(stage):
    cell = stage.simulated("x", devices=found(stage, PV, target_velocity=TURNING))
    cell.must_move(faster_than=45.0)
    return cell


def controlwords(cell) -> list[int]:
    """Everything that was sent to 6040h since the machine was opened."""
    seen = []
    port = cell.port()
    write = port.write

    def watched(outputs) -> None:
        if outputs.controlword is not None:
            seen.append(outputs.controlword)
        write(outputs)

    port.write = watched
    return seen


def test_a_drive_found_at_standstill_is_reported_and_gets_no_controlword(scenario):
    cell = at_rest(scenario)
    sent = controlwords(cell)
    cell.run(1.0)
    assert sent == []
    assert cell.stage() == ENABLED
    assert cell.x.state is AxisState.STANDSTILL
    (report,) = cell.machine.reports
    assert report.axes[0].found_enabled
    assert "found enabled: left unchanged and not configured" in report.text()


def test_a_drive_found_turning_continues_turning(scenario):
    cell = turning(scenario)
    sent = controlwords(cell)
    cell.run(1.0)
    assert sent == []
    cell.must_move(faster_than=45.0)
    assert cell.x.state is AxisState.CONTINUOUS_MOTION


def test_motion_commands_to_a_found_drive_are_refused_with_how_to_take_it_over(scenario, golden):
    cell = turning(scenario)
    refused = cell.failure_of(cell.x.move_relative(10.0))
    assert isinstance(refused, StateError)
    golden("found_enabled_move", refused)
    cell.run(0.5)
    cell.must_move(faster_than=45.0)


def test_leaving_the_with_block_leaves_an_untouched_drive_as_it_was_found(scenario):
    cell = turning(scenario)
    sent = controlwords(cell)
    consumer = cell.device().read(0x1016, 1)
    with cell.machine:
        cell.run(0.3)
        assert cell.device().read(0x1016, 1) != consumer or consumer
    cell.run(2.0)  # our heartbeat is gone: nothing waits for it
    assert sent == []
    cell.must_move(faster_than=45.0)
    assert cell.stage() == ENABLED
    assert cell.device().nmt is NmtState.OPERATIONAL
    assert cell.device().errors.register == 0


def test_enable_takes_a_resting_drive_over_without_a_jump(scenario):
    cell = at_rest(scenario)
    sent = controlwords(cell)
    place = cell.where()
    cell.x.enable().wait(3)
    assert cell.stage() == ENABLED
    assert all(word & 0x0F == 0x0F for word in sent)  # it was enabled all the time
    assert abs(cell.where() - place) < 0.02
    cell.x.move_relative(10.0).wait(5)
    cell.run(0.3)
    assert abs(cell.where() - place - 10.0) < 0.1


@pytest.mark.parametrize("mode", [PV, PP, CSP])
def test_enable_takes_a_moving_drive_over_by_braking_it_on_its_ramp(scenario, mode):
    cell = scenario.simulated("x", devices=found(scenario, mode, target_velocity=TURNING))
    if mode == PP:  # moving to a far target of the other master
        cell.device().write(0x6081, 0, TURNING)
        cell.drive().target_position = 1_000_000
        cell.drive().controlword = 0x3F
        cell.drive().evaluate_controlword()
        cell.run(0.5)
    if mode != CSP:
        cell.must_move(faster_than=45.0)
    start = cell.where()
    cell.x.enable().wait(3)
    cell.run(0.3)
    assert cell.stage() == ENABLED
    assert cell.speed() == 0.0, cell.told()
    assert abs(cell.where() - start) < 10.0  # 50 deg/s with 500 deg/s² are 2.5 deg
    assert cell.x.state is AxisState.STANDSTILL
    place = cell.where()
    cell.run(1.0)
    assert abs(cell.where() - place) < 0.02


OFFSET = 30_000  # position increments


def with_offset(stage):
    """A drive at standstill in csp, whose position offset compensates its target."""
    make = found(stage, CSP, target_position=-OFFSET)

    def made() -> dict[int, Device]:
        devices = make()
        devices[1].write(0x60B0, 0, OFFSET)
        return devices

    return made


def test_enable_adopts_a_drive_whose_position_offset_acts(scenario):
    cell = scenario.simulated("x", devices=with_offset(scenario))
    place = cell.where()
    cell.x.enable().wait(3)
    cell.run(0.5)
    assert cell.stage() == ENABLED
    assert abs(cell.where() - place) < 0.02
    assert cell.device().read(0x60B0, 0) == 0


def test_a_drive_that_cannot_be_taken_over_without_a_jump_is_left_at_its_position(scenario, golden):
    cell = scenario.simulated("x", devices=with_offset(scenario), axis='modes = ["csp"]')
    place = cell.where()
    golden("found_enabled_with_an_offset", cell.failure_of(cell.x.enable()))
    cell.run(0.5)
    assert abs(cell.where() - place) < 0.02


@pytest.mark.nets("the stop sequence")
def test_disable_stops_a_found_turning_drive(scenario):
    cell = turning(scenario)
    handle = cell.x.disable()
    cell.must_be_still(within=1.0, stages=(SWITCH_ON_DISABLED, SWITCHED_ON))
    handle.wait(1)
    assert cell.stage() == SWITCH_ON_DISABLED


@pytest.mark.nets("the stop sequence")
def test_halt_stops_a_found_turning_drive(scenario):
    cell = turning(scenario)
    handle = cell.x.halt()
    cell.must_be_still(within=1.0, stages=ENABLED)
    handle.wait(1)


def test_a_fault_of_another_axis_does_not_affect_a_drive_that_we_did_not_enable(scenario):
    def both():
        (mine,) = found(scenario, PP)().values()
        other = device_from_eds(eds.load(resolve(GENERIC, scenario.folder)), 2)
        return {1: mine, 2: other}

    cell = scenario.simulated("xy", devices=both)
    sent = controlwords(cell)
    cell["y"].enable().wait(3)
    cell.drive("y").fault(0x2310)
    cell.run(1.0)
    assert sent == []
    assert cell.stage("x") == ENABLED
