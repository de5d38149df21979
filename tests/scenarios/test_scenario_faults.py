"""A drive goes into fault: it and its group stop, the table of the make gives the reason, and only a reset permits new commands."""

from __future__ import annotations

import pytest

from axisbus.eds.builtin import resolve
from axisbus.errors import DriveFault, StateError, Stopped, TransitionError
from axisbus.motion.states import AxisState
from axisbus.sim.build import device_from_eds
from kit.cell import MODULE
from kit.plant_probe import ENABLED, FAULT, OFF, SWITCH_ON_DISABLED

# gim6010-8, manual 5.7: category, bit, 603Fh.
MOSFET_HOT = 0x0004_0000, 0x4310
CURRENT_LIMIT = 0x0000_1000, 0x2311
GAINS_UNKNOWN = 0x2_0000_0000, 0x6320


def faulty_device(stage):
    """A module that is in fault before the machine is opened."""
    from axisbus import eds

    def make():
        device = device_from_eds(eds.load(resolve(MODULE, stage.folder)), 1)
        device.power_on()
        device.drives[0].fault(CURRENT_LIMIT[1], CURRENT_LIMIT[0])
        return {1: device}

    return make


@pytest.mark.nets("the stop sequence")
def test_a_fault_in_mid_move_stops_the_group_and_is_reported_in_the_makers_words(scenario, golden):
    cell = scenario.simulated("xy", eds=MODULE)
    faulty, other = cell.travelling()
    cell.drive("x").fault(MOSFET_HOT[1], MOSFET_HOT[0])
    cell.must_be_still("x", within=1.0, stages=FAULT)
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    fault = cell.failure_of(faulty)
    assert isinstance(fault, DriveFault)
    assert fault.code == 0x4310
    golden("fault_in_mid_move", fault)
    assert isinstance(cell.failure_of(other), Stopped)
    golden("fault_in_mid_move_others", cell.failure_of(other))


def test_bits_in_the_high_word_are_decoded_too(scenario, golden):
    cell = scenario.simulated("x", eds=MODULE)
    (handle,) = cell.travelling()
    cell.drive().fault(GAINS_UNKNOWN[1], GAINS_UNKNOWN[0])
    golden("fault_high_bits", cell.failure_of(handle))


def test_a_fault_is_reported_by_its_emcy_if_the_drive_aborts_the_read_of_603fh(scenario, golden):
    cell = scenario.simulated("x")
    (handle,) = cell.travelling()
    cell.device().dials.sdo_aborts[0x603F, 0] = 0x0800_0000
    cell.drive().fault(0x8611)
    fault = cell.failure_of(handle)
    assert isinstance(fault, DriveFault)
    assert fault.code == 0x8611
    golden("fault_by_emcy", fault)


def test_an_unknown_error_code_is_a_value_and_no_crash(scenario, golden):
    cell = scenario.simulated("x")
    (handle,) = cell.travelling()
    cell.drive().fault(0xFFCD)
    golden("fault_unknown_code", cell.failure_of(handle))


def test_a_fault_while_disabled_is_reported_and_stops_no_axis_at_standstill(scenario, golden):
    cell = scenario.simulated("xy", eds=MODULE)
    cell["y"].enable().wait(3)
    cell.drive("x").fault(CURRENT_LIMIT[1], CURRENT_LIMIT[0])
    cell.run(0.5)
    assert cell["x"].state is AxisState.ERRORSTOP
    assert isinstance(cell["x"].error, DriveFault)
    golden("fault_while_disabled", cell["x"].error)
    assert cell["y"].state is AxisState.STANDSTILL
    assert cell.stage("y") == ENABLED


def test_a_drive_in_fault_at_boot_up_is_opened_and_the_fault_is_reported(scenario, golden):
    cell = scenario.simulated("x", eds=MODULE, devices=faulty_device(scenario))
    cell.run(0.5)
    assert cell.x.state is AxisState.ERRORSTOP
    golden("fault_at_boot", cell.x.error)
    assert cell.stage() == FAULT  # nothing was sent to it


def test_enable_from_fault_ends_with_reset_first(scenario, golden):
    cell = scenario.simulated("x", eds=MODULE, devices=faulty_device(scenario))
    cell.run(0.5)
    refused = cell.failure_of(cell.x.enable())
    assert isinstance(refused, StateError)
    golden("enable_from_fault", refused)
    assert cell.stage() == FAULT


def test_a_fault_that_was_reset_allows_service_again(scenario):
    cell = scenario.simulated("x", eds=MODULE, devices=faulty_device(scenario))
    cell.run(0.5)
    cell.x.reset().wait(3)
    assert cell.stage() == SWITCH_ON_DISABLED  # a reset never enables
    assert cell.x.state is AxisState.DISABLED
    cell.x.enable().wait(3)
    cell.x.move_relative(10.0).wait(5)


def test_a_reset_that_does_not_work_names_the_fault_that_stays(scenario, golden):
    cell = scenario.simulated("xy", eds=MODULE)
    handles = cell.travelling()
    cell.drive("x").dials.fault_persists = True
    cell.drive("x").fault(MOSFET_HOT[1], MOSFET_HOT[0])
    cell.failure_of(handles[0])
    cell.run(1.0)
    moving = cell["y"].move_relative(500.0, velocity=100.0)
    cell.run(0.3)
    failed = cell.failure_of(cell["x"].reset())
    assert isinstance(failed, TransitionError)
    golden("reset_without_effect", failed)
    assert cell.stage("x") == FAULT
    assert cell["x"].state is AxisState.ERRORSTOP
    cell.must_move("y")  # the fault was there before: trying to reset it is no new one
    assert moving.busy


@pytest.mark.nets("the stop sequence")
def test_a_fault_in_the_moment_of_enabling_stops_the_others(scenario, golden):
    cell = scenario.simulated("xy")
    cell["y"].enable().wait(3)
    cell["y"].move_velocity(90.0).wait(3)
    cell.drive("x").dials.fault_on_enable = 0x7121
    failed = cell.failure_of(cell["x"].enable())
    cell.must_be_still("x", within=0.5, stages=OFF)
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    golden("fault_on_enable", failed)


def test_an_emergency_of_two_bytes_is_read(scenario):
    cell = scenario.simulated("x")
    (handle,) = cell.travelling()
    cell.device().dials.emcy_short = True
    cell.drive().fault(0x2310)
    fault = cell.failure_of(handle)
    assert isinstance(fault, DriveFault)
    assert fault.code == 0x2310
