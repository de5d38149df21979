"""Enabling, disabling and reset: the states of the power stage as the drive sees them, without any motion."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import pytest

from axisbus.cia402.port import Sample, ValueTransport
from axisbus.errors import DriveError, DriveFault, ModeError, StaleError, StateError, Stopped, TransitionError
from axisbus.motion.command_status import Status
from axisbus.motion.states import AxisState
from axisbus.sim.drive import Drive
from axisbus.sim.fault_injection import NEVER
from kit.motion.plant_recorder import (
    DISABLED,
    ENABLE_BITS,
    ENABLED,
    FAULT,
    FAULT_RESET,
    NOT_READY,
    QUICK_STOP,
    READY,
    SWITCHED_ON,
    Watch,
)
from kit.motion.rig import PERIOD, rig


def bring_to(r, stage: int) -> None:
    """Put the simulated drive into a power-stage state, as another master or tool would have left it."""
    power, drive = r.drive.power, r.drive
    if stage == NOT_READY:
        power.stage, power.pending, power._timer = power.stage.__class__(NOT_READY), 1, 0.05
        return
    if stage == ENABLED:
        drive.start_enabled(1)
    elif stage == QUICK_STOP:
        r.device.write(0x605A, 0, 6)
        drive.start_enabled(1)
        drive.controlword = 0x02
        drive.evaluate_controlword()
    elif stage == FAULT:
        drive.fault(0x2310)
    else:
        for word in {DISABLED: (0x00,), READY: (0x06,), SWITCHED_ON: (0x06, 0x07)}[stage]:
            drive.controlword = word
            drive.evaluate_controlword()
            drive.step(0.005)
    r.run(0.1)
    assert drive.power.stage == stage


# Enable.


def test_enable_takes_transitions_2_3_4_and_holds_the_axis():
    r = rig()
    watch = Watch(r)
    r.axis.enable().wait(1)
    assert watch.transitions == [2, 3, 4]
    assert watch.words == [0x00, 0x06, 0x07, 0x0F]  # 0x00 holds while the mode is awaited
    assert r.axis.state is AxisState.STANDSTILL
    r.run(1.0)
    assert watch.transitions == [2, 3, 4]
    assert watch.words == [0x00, 0x06, 0x07, 0x0F]
    assert watch.displacement == 0.0


def test_nothing_is_sent_before_the_first_command_to_an_axis():
    r = rig()
    watch = Watch(r)
    r.run(1.0)
    assert [item for item in watch.sent if any(item.outputs)] == []


def test_enable_twice_is_harmless():
    r = rig().enabled()
    watch = Watch(r)
    first, second = r.axis.enable(), r.axis.enable()
    first.wait(1)
    second.wait(1)
    r.run(0.5)
    assert watch.transitions == []
    assert watch.words == [0x0F]


@pytest.mark.parametrize("again_after", [PERIOD, 0.1, 0.2])
def test_a_repeated_enable_continues_and_both_handles_end_as_it_does(again_after):
    r = rig()
    r.drive.dials.transition_delay[3] = 0.2
    watch = Watch(r)
    first = r.axis.enable()
    r.run(again_after)
    assert r.drive.power.stage != ENABLED
    second, third = r.axis.enable(), r.axis.enable()
    third.wait(2)
    assert first.done
    assert second.done
    assert r.drive.power.stage == ENABLED
    assert watch.transitions == [2, 3, 4]


def test_a_repeated_enable_that_fails_fails_for_both_handles():
    r = rig()
    r.drive.dials.transition_delay[3] = 1e9
    first = r.axis.enable()
    r.run(0.5)
    second = r.axis.enable()
    r.until(lambda: not second.busy)
    assert isinstance(first.exception(), TransitionError)
    assert second.exception() is first.exception()
    assert second.status is Status.ERROR


def test_a_repeated_enable_is_aborted_for_both_handles_by_a_disable():
    r = rig()
    r.drive.dials.transition_delay[3] = 0.2
    first = r.axis.enable()
    r.run(0.1)
    second = r.axis.enable()
    r.run(PERIOD)
    r.axis.disable().wait(3)
    assert first.aborted
    assert second.aborted
    assert isinstance(second.exception(), Stopped)
    assert r.drive.power.stage == DISABLED


def test_a_repeated_reset_makes_no_second_edge():
    r = rig().enabled()
    r.drive.fault(0x4310)
    r.run(1.0)
    watch = Watch(r)
    first = r.axis.reset()
    r.run(PERIOD)
    second = r.axis.reset()
    second.wait(3)
    assert first.done
    assert watch.words.count(0x80) == 1
    assert watch.transitions == [15]


@pytest.mark.parametrize("what", [{}, {"coast": True}], ids=["by the stop sequence", "coasting"])
def test_a_repeated_disable_ends_with_the_first(what):
    r = rig().enabled()
    r.drive.dials.transition_delay[5] = r.drive.dials.transition_delay[9] = 0.1
    first = r.axis.disable(**what)
    r.run(2 * PERIOD)
    assert first.active
    second = r.axis.disable(**what)
    second.wait(3)
    assert first.done
    assert r.drive.power.stage == DISABLED


@pytest.mark.parametrize(
    ("stage", "path"),
    [
        (NOT_READY, [1, 2, 3, 4]),
        (DISABLED, [2, 3, 4]),
        (READY, [3, 4]),
        (SWITCHED_ON, [4]),
        (ENABLED, []),
        (QUICK_STOP, [16]),
    ],
)
def test_enable_from_every_state_of_the_power_stage(stage, path):
    r = rig()
    bring_to(r, stage)
    watch = Watch(r)
    r.axis.enable().wait(3)
    assert watch.transitions == path
    assert r.drive.power.stage == ENABLED
    assert watch.displacement < 1.0
    assert r.axis.state is AxisState.STANDSTILL


def test_a_drive_held_in_quick_stop_keeps_its_power_until_enable_makes_transition_16():
    """A power cycle (12, 2, 3, 4) would drop a hanging load."""
    r = rig()
    bring_to(r, QUICK_STOP)
    watch = Watch(r)
    r.run(1.0)
    assert watch.transitions == []
    assert watch.words == []
    r.axis.enable().wait(2)
    assert watch.transitions == [16]


def test_a_drive_that_left_quick_stop_is_enabled_after_a_reset():
    r = rig()
    r.device.write(0x605A, 0, 6)
    r.enabled()
    r.axis.quick_stop().wait(2)
    r.device.write(0x605A, 0, 2)  # 16 is not taken with this option
    watch = Watch(r)
    r.drive.controlword = 0x00
    r.drive.evaluate_controlword()
    with pytest.raises(DriveError):  # it left the held state: that is reported
        r.axis.enable().wait(3)
    r.axis.reset().wait(1)
    r.axis.enable().wait(3)
    assert watch.transitions == [12, 2, 3, 4]


def test_enable_in_fault_is_refused_with_reset_first_and_sends_no_enable():
    r = rig()
    bring_to(r, FAULT)
    watch = Watch(r)
    handle = r.axis.enable()
    with pytest.raises(StateError, match="reset"):
        handle.wait(1)
    r.run(0.5)
    assert all(word & ENABLE_BITS != ENABLE_BITS for word in watch.words)
    assert r.drive.power.stage == FAULT


def test_a_fault_while_enabling_ends_the_handle_with_its_cause():
    r = rig()
    r.drive.dials.fault_on_enable = 0x3210
    handle = r.axis.enable()
    with pytest.raises(DriveFault) as caught:
        handle.wait(2)
    assert caught.value.code == 0x3210
    assert "during x.enable()" in caught.value.message
    assert "reset" in caught.value.remedy
    assert r.axis.state is AxisState.ERRORSTOP
    watch = Watch(r)
    r.run(1.0)
    assert watch.words == [0x00]


@pytest.mark.parametrize(
    ("number", "stuck"), [(2, "switch on disabled"), (3, "ready to switch on"), (4, "switched on")]
)
def test_a_transition_that_is_not_taken_names_the_state_the_words_and_why(number, stuck):
    r = rig()
    r.drive.dials.transition_delay[number] = NEVER
    r.drive.dials.no_voltage = True
    start = r.now
    with pytest.raises(TransitionError) as caught:
        r.axis.enable().wait(10)
    assert 2.0 <= r.now - start < 2.3  # one step's time
    error = caught.value
    assert stuck in error.message
    assert f"0x{ {2: 0x06, 3: 0x07, 4: 0x0F}[number]:04X}" in error.observed or number == 4
    assert "bit 4 (voltage enabled) is 0" in error.remedy
    r.run(0.5)
    assert r.drive.power.stage == DISABLED  # taken back: nothing is left half enabled
    assert r.axis.state is AxisState.ERRORSTOP


def test_a_drive_that_still_initialises_is_named_so_and_not_its_supply():
    r = rig()
    bring_to(r, NOT_READY)
    r.drive.power._timer = NEVER
    r.drive.dials.no_voltage = True
    with pytest.raises(TransitionError, match="not ready to switch on") as caught:
        r.axis.enable().wait(10)
    assert "initialises" in caught.value.remedy
    assert "transition_time" in caught.value.remedy
    assert "voltage" not in caught.value.remedy


def test_a_drive_that_falls_back_again_and_again_is_given_up():
    """Each attempt resets nothing: the time of a state that was seen before is not granted again."""
    r = rig()
    watch = Watch(r)
    handle = r.axis.enable()

    def drop() -> None:
        if r.drive.power.stage == SWITCHED_ON:
            r.drive.controlword = 0x00
            r.drive.evaluate_controlword()

    start = r.now
    while handle.busy and r.now - start < 20:
        r.run(PERIOD)
        drop()
    assert isinstance(handle.exception(), TransitionError)
    assert r.now - start < 5
    assert 4 not in watch.transitions


def test_a_drive_that_drops_out_right_after_being_enabled_is_not_enabled_again():
    r = rig()
    r.drive.dials.mode_delay = 0.3  # the enable still waits for 6061h when the power goes
    r.drive.mode_display = 0
    watch = Watch(r)
    handle = r.axis.enable()
    while 4 not in watch.transitions:
        r.run(PERIOD)
    r.run(2 * PERIOD)
    r.drive.power.stage = type(r.drive.power.stage)(DISABLED)  # safe torque off
    r.run(3.0)
    assert watch.transitions.count(4) == 1
    assert r.axis.state is AxisState.ERRORSTOP or not handle.error


def test_a_node_that_was_lost_is_not_enabled():
    r = rig()
    r.cycle.nmt(0x80)
    r.run(0.5)
    with pytest.raises(StateError, match="node 1 is lost"):
        r.axis.enable().wait(1)
    assert r.drive.power.stage == DISABLED


def test_enable_needs_a_position():
    r = rig(port={"inputs": {"position": ValueTransport.NONE}})
    with pytest.raises(StaleError, match="6064h"):
        r.axis.enable().wait(3)
    assert r.drive.power.stage == DISABLED


def test_an_axis_that_is_enabled_holds_the_target_that_it_was_enabled_with():
    """Its targets once followed the position, late by the bus: a soft load swung up to 160 deg/s by that."""
    r = rig(port={"inputs": {"demand": ValueTransport.NONE}})
    r.run(0.2)
    port, targets, sign = r.ports["x"], [], 1
    read = port.read

    def swinging(now: float):
        nonlocal sign
        inputs, sign = read(now), -sign
        if r.drive.power.stage != ENABLED or r.now > 1.5:
            return inputs
        return inputs._replace(position=Sample(inputs.position.value + 3 * sign, inputs.position.stamp))

    port.read = swinging
    handle = r.axis.enable()
    while handle.busy and r.now < 5.0:
        r.run(PERIOD)
        if r.drive.power.stage == ENABLED:
            targets.append(r.drive.target_position)
    handle.wait(1)
    assert len(targets) > 5
    assert len(set(targets[3:])) == 1, targets


@pytest.mark.parametrize("blind_from", range(0, 14, 2))
def test_a_late_position_is_awaited_while_enabling(blind_from):
    """For 0.6 s no 6064h is received, from a cycle of enabling on: it is enabled with a fresh one, and nothing jumps."""
    r = rig()
    r.run(0.5)
    port = r.ports["x"]
    read, since = port.read, r.now + blind_from * PERIOD

    def blind(now):
        inputs = read(now)
        return inputs._replace(position=None, demand=None) if since <= now < since + 0.6 else inputs

    port.read = blind
    watch = Watch(r)
    r.axis.enable().wait(3)
    ways_up = [row.t for before, row in pairwise(watch.rows) if row.stage == ENABLED != before.stage]
    assert len(ways_up) == 1
    assert not since + 2 * PERIOD < ways_up[0] < since + 0.6
    assert {row.position for row in watch.rows} == {watch.rows[0].position}


def test_a_drive_that_displays_its_mode_only_when_enabled_is_enabled():
    r = rig()
    r.drive.mode = r.drive.mode_display = 0
    r.drive.dials.modes_refused = frozenset({1})
    watch = Watch(r)
    handle = r.axis.enable()
    while 4 not in watch.transitions:
        r.run(PERIOD)
    r.drive.dials.modes_refused = frozenset()
    handle.wait(3)
    assert r.drive.mode_display == 1


def test_a_drive_that_takes_a_mode_only_when_enabled_is_enabled_again_after_its_homing():
    r = rig().enabled()
    follow = Drive._follow_mode

    def when_enabled(drive, dt):
        if drive.power.stage == ENABLED:
            follow(drive, dt)

    r.drive._follow_mode = partial(when_enabled, r.drive)
    r.axis.home(37).wait(5)
    r.axis.disable().wait(5)
    assert r.drive.mode_display == 6
    watch = Watch(r)
    r.axis.enable().wait(10)
    assert watch.displacement == 0.0
    assert r.drive.mode_display != 6
    r.axis.move_relative(10.0).wait(10)
    assert r.axis.position == pytest.approx(10.0, abs=0.01)


@pytest.mark.parametrize("shown", [2, 6])
def test_a_drive_that_refuses_every_resting_mode_does_not_stay_enabled(shown):
    """In homing mode (6) nothing moves, and a drive may take its mode only when it is enabled: only this one is enabled to see."""
    r = rig()
    r.drive.mode = r.drive.mode_display = shown
    r.drive.dials.modes_refused = frozenset({1, 3, 4, 8, 9})
    watch = Watch(r)
    with pytest.raises(ModeError, match="hold standstill"):
        r.axis.enable().wait(10)
    r.run(1.0)
    assert r.drive.power.stage == DISABLED
    assert (4 in watch.transitions) is (shown == 6)
    assert watch.displacement == 0.0


# Disable.


def test_disable_takes_transition_5_and_then_down_never_9():
    r = rig().enabled()
    watch = Watch(r)
    r.axis.disable().wait(2)
    assert watch.transitions == [5, 6, 7]
    assert watch.words == [0x10F, 0x107, 0x06, 0x00]  # halted until the drive has left the state
    assert r.axis.state is AxisState.DISABLED


def test_disable_while_moving_brakes_first():
    r = rig().enabled()
    move = r.axis.move_absolute(360.0)
    r.run(0.5)
    watch = Watch(r)
    r.axis.disable().wait(3)
    assert watch.transitions == [5, 6, 7]
    speed_at_5 = next(abs(row.velocity) for row in watch.rows if row.stage == SWITCHED_ON)
    assert speed_at_5 < 1.0
    assert watch.acceleration() < 500_000 * 1.02  # the profile's own deceleration, 500 deg/s²
    assert isinstance(move.exception(), Stopped)


def test_disable_twice_is_harmless():
    r = rig().enabled()
    first, second = r.axis.disable(), r.axis.disable()
    first.wait(2)
    second.wait(2)
    watch = Watch(r)
    r.axis.disable().wait(1)
    r.run(0.5)
    assert watch.transitions == []
    assert watch.words == [0x00]
    assert r.axis.error is None


def test_disable_coasts_only_if_coast_is_given():
    r = rig().enabled()
    r.axis.move_velocity(100.0).wait(2)
    watch = Watch(r)
    r.axis.disable(coast=True).wait(2)
    assert watch.transitions == [9]
    assert watch.words == [0x00]
    assert abs(r.drive.axis.motor.velocity) > 50_000  # it still turns: nothing brakes it
    assert r.axis.state is AxisState.DISABLED


def test_coasting_out_of_errorstop_does_not_clear_the_error():
    r = rig().enabled()
    with pytest.raises(DriveError):
        r.axis.move_absolute(100.0, timeout=0.2).wait(5)
    r.until(lambda: r.core.stop_sequence is None)
    r.axis.disable(coast=True).wait(2)
    assert r.axis.state is AxisState.ERRORSTOP
    assert r.axis.error is not None
    r.axis.reset().wait(1)
    assert r.axis.state is AxisState.DISABLED


def test_disable_during_enable_takes_the_power_stage_down_again():
    r = rig()
    r.drive.dials.transition_delay[4] = 0.3
    watch = Watch(r)
    enable = r.axis.enable()
    r.run(0.15)
    r.axis.disable().wait(2)
    assert isinstance(enable.exception(), Stopped)
    assert r.drive.power.stage == DISABLED
    r.run(1.0)
    assert r.drive.power.stage == DISABLED
    assert watch.transitions.count(4) <= 1


def test_enable_during_disable_is_refused_and_the_axis_is_disabled():
    r = rig().enabled()
    r.axis.move_velocity(100.0).wait(2)
    disable = r.axis.disable()
    r.run(0.05)
    with pytest.raises(StateError, match="being stopped"):
        r.axis.enable().wait(2)
    disable.wait(3)
    assert r.drive.power.stage == DISABLED


def test_a_move_during_disable_is_refused():
    r = rig().enabled()
    r.axis.move_velocity(100.0).wait(2)
    disable = r.axis.disable()
    r.run(0.05)
    with pytest.raises(StateError, match="being stopped"):
        r.axis.move_absolute(0.0).wait(2)
    disable.wait(3)
    assert r.drive.power.stage == DISABLED
    assert r.axis.state is AxisState.DISABLED


def test_halt_during_enable_takes_it_back():
    r = rig()
    r.drive.dials.transition_delay[3] = 0.2
    enable = r.axis.enable()
    r.run(0.1)
    r.axis.halt().wait(1)
    assert isinstance(enable.exception(), Stopped)
    r.run(1.0)
    assert r.drive.power.stage == DISABLED
    assert r.axis.state is AxisState.DISABLED


# Reset.


def test_reset_is_one_rising_edge_and_never_enables():
    r = rig().enabled()
    r.drive.fault(0x2310)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP)
    r.run(0.5)
    watch = Watch(r)
    r.axis.reset().wait(2)
    assert watch.transitions == [15]
    assert watch.words == [0x00, 0x80, 0x00] or watch.words == [0x00, 0x80]
    r.run(1.0)
    assert watch.transitions == [15]
    assert watch.words == [0x00, 0x80, 0x00]
    assert r.axis.state is AxisState.DISABLED
    assert r.axis.error is None


def test_reset_without_a_fault_sends_nothing_new():
    r = rig().enabled()
    watch = Watch(r)
    r.axis.reset().wait(1)
    r.axis.reset().wait(1)
    assert watch.words == [0x0F]
    assert r.axis.state is AxisState.STANDSTILL


def test_a_fault_that_persists_gets_a_new_edge_and_is_then_reported_with_its_cause():
    r = rig().enabled()
    r.drive.dials.fault_persists = True
    r.drive.fault(0x4210)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP)
    r.run(0.5)
    watch = Watch(r)
    with pytest.raises(TransitionError) as caught:
        r.axis.reset().wait(5)
    edges = [
        b
        for a, b in zip(watch.words, watch.words[1:], strict=False)
        if b & FAULT_RESET and not a & FAULT_RESET
    ]
    assert len(edges) >= 1
    assert "does not clear the fault" in caught.value.message
    assert r.axis.state is AxisState.ERRORSTOP
    assert "4210" in str(r.axis.error)  # the first reason stays, later ones are added
    assert "does not clear the fault" in str(r.axis.error)
    r.drive.dials.fault_persists = False
    r.axis.reset().wait(3)
    assert r.axis.state is AxisState.DISABLED


def test_bit_7_is_low_before_every_edge_even_when_another_master_left_it_high():
    r = rig()
    r.drive.fault(0x2310)
    r.drive.controlword = 0x80
    r.drive.evaluate_controlword()
    r.drive.fault(0x2310)
    r.drive._word = 0x80
    r.run(0.5)
    watch = Watch(r)
    r.axis.reset().wait(3)
    zeros = [item.t for item in watch.sent if item.outputs.controlword == 0]
    ones = [item.t for item in watch.sent if item.outputs.controlword == 0x80]
    assert zeros[0] < ones[0]
    assert ones[0] - zeros[0] >= 2 * PERIOD - 1e-9


def test_a_drive_that_drops_out_in_errorstop_is_not_enabled_again():
    """In ErrorStop the axis is held; a supply that returns must not restore the power."""
    r = rig().enabled()
    with pytest.raises(DriveError):
        r.axis.move_absolute(100.0, timeout=0.2).wait(5)
    r.until(lambda: r.core.stop_sequence is None)
    assert r.drive.power.stage == ENABLED
    watch = Watch(r)
    r.drive.controlword = 0x00  # an enable input was cut
    r.drive.evaluate_controlword()
    r.run(2.0)
    assert watch.transitions == [9]
    assert all(word & ENABLE_BITS != ENABLE_BITS for word in watch.words[1:])
    assert r.axis.state is AxisState.ERRORSTOP


def test_a_drive_that_drops_out_at_standstill_is_reported_and_stays_off():
    r = rig().enabled()
    watch = Watch(r)
    r.drive.controlword = 0x00
    r.drive.evaluate_controlword()
    r.run(1.0)
    assert watch.transitions == [9]
    assert r.axis.state is AxisState.ERRORSTOP
    assert "left operation enabled without a command" in str(r.axis.error)
    r.axis.reset().wait(1)
    assert r.axis.state is AxisState.DISABLED
    r.run(1.0)
    assert watch.transitions == [9]


def test_a_drive_found_enabled_is_left_as_it_is_and_refuses_motion_until_it_is_taken_over():
    r = rig()
    r.drive.start_enabled(3)
    r.run(0.2)
    watch = Watch(r)
    assert r.axis.state is AxisState.STANDSTILL
    with pytest.raises(StateError, match="found enabled"):
        r.axis.move_velocity(10.0).wait(1)
    r.run(0.5)
    assert watch.words == []
    r.axis.enable().wait(2)
    assert watch.transitions == []
    assert r.drive.mode_display == 3  # it keeps its mode
    r.axis.move_velocity(10.0).wait(2)


def test_a_drive_found_moving_is_taken_over_without_a_jump():
    r = rig()
    r.drive.start_enabled(3)
    r.drive.target_velocity = 50_000
    r.run(1.0)
    assert r.axis.state is AxisState.CONTINUOUS_MOTION
    watch = Watch(r)
    r.axis.enable().wait(2)
    r.run(1.0)
    assert watch.transitions == []
    assert r.drive.velocity == 0
    assert watch.acceleration() <= 1_000_000 * 1.02  # 6084h of the drive
    assert r.axis.state is AxisState.STANDSTILL


def test_handles_of_power_commands_report_how_they_ended():
    r = rig()
    handle = r.axis.enable()
    assert handle.busy
    assert handle.status is Status.BUSY
    r.run(PERIOD)
    assert handle.active
    handle.wait(1)
    assert handle.done


def test_a_drive_in_fault_again_during_the_diagnosis_of_the_first_fault_is_not_enabled():
    r = rig()
    r.run(0.1)
    r.device.dials.sdo_delay = 0.3  # of 603Fh
    r.drive.fault(0x2310)
    r.run(0.03)
    r.axis.reset().wait(1)
    r.drive.fault(0x3210)
    r.run(0.02)
    with pytest.raises(StateError, match="is in ErrorStop"):
        r.axis.enable().wait(1)
    r.run(1.0)
    assert r.axis.error.code == 0x3210
