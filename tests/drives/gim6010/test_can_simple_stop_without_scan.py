"""A module is stopped without the scan that commanded it: braked, switched off, at last by ESTOP, until standstill is seen."""

from __future__ import annotations

from dataclasses import replace

import pytest

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.port.stop_without_scan import ModuleRescue, RescueStep
from axisbus.drives.gim6010.sim.module import Module
from kit.can_simple.rig import OWN, SETTINGS

MODE, VEL, STATE, ESTOP = 0x0B, 0x0D, 0x07, 0x02  # manual 4.1.2
STEP = 0.005


def turning(velocity: float = 4.0) -> Module:
    """A module that its master has left at a velocity."""
    module = Module(5, **OWN)
    module.parameters["axis0.controller.config.control_mode"] = 2
    module.parameters["axis0.controller.config.input_mode"] = 2
    module.axis.request(8)
    module.axis.controller.take(vel=velocity)
    for number in range(200):
        module.step(number * STEP)
    module.take_frames()
    return module


def rescue(
    module: Module,
    lost: set[int] = frozenset(),
    *,
    holds: bool = False,
    after: float = 1.0,
    longest: float = 12.0,
    counts: bool = True,
    brake: float = 6.0,
):
    """Let it be stopped; return the rescue, the commands that were sent, and the seconds that it took."""
    one = ModuleRescue(replace(SETTINGS, quick_stop_holds=holds), counts=counts, longest=brake)
    sent, now = [], after
    while not one.text:
        assert now - after < longest
        now += STEP
        module.step(now)
        for can_id, data in module.take_frames():
            one.receive(CanFrame(now, can_id, bytes(data)), now)
        for each in one.step(now):
            command = each.can_id & 0x1F
            sent += [] if each.remote else [(command, each.data[0])]
            if command not in lost:
                module.on_frame(each.can_id, each.data, now, remote=each.remote)
    return one, sent, now - after


def test_the_rescue_brakes_the_module_on_its_own_ramp_and_then_switches_its_power_off():
    module = turning()
    one, sent, _ = rescue(module)
    assert (one.ok, one.text) == (True, "stands, without power")
    assert not module.energised
    assert abs(module.shaft.speed) < 0.01
    commands = [command for command, _ in sent]
    assert commands[:2] == [MODE, VEL]
    assert ESTOP not in commands
    assert {value for command, value in sent if command == STATE} == {1}


def test_the_rescue_keeps_the_power_of_a_module_that_is_to_hold():
    module = turning(-6.0)
    one, sent, _ = rescue(module, holds=True)
    assert (one.ok, one.text) == (True, "is at standstill, and its module holds it")
    assert module.energised
    assert abs(module.shaft.speed) < 0.01
    assert {command for command, _ in sent} == {MODE, VEL}


def test_the_rescue_does_not_enable_a_module_that_is_off():
    module = Module(5, **OWN)
    one, sent, seconds = rescue(module, after=0.0)
    assert one.ok
    assert seconds < 0.5
    assert not module.energised
    assert {command for command, _ in sent} <= {MODE, VEL}


def test_the_rescue_switches_off_a_module_that_does_not_brake_and_waits_for_its_standstill():
    module = turning()
    one, _, seconds = rescue(module, {MODE, VEL})
    assert one.ok
    assert not module.energised
    assert seconds > 2.0
    assert abs(module.shaft.speed) < 0.02


def test_the_rescue_sends_estop_to_a_module_that_stays_energised():
    module = turning()
    one, sent, _ = rescue(module, {MODE, VEL, STATE})
    assert (ESTOP, 0) in sent
    assert one.ok
    assert not module.energised
    assert module.axis.faulty


@pytest.mark.parametrize("dead", [False, True])
def test_the_rescue_reports_a_module_that_obeys_nothing_as_not_confirmed(dead):
    module = turning()
    module.dials.dead = dead
    one, _, seconds = rescue(module, {MODE, VEL, STATE, ESTOP})
    assert not one.ok
    assert one.text.startswith("NOT CONFIRMED as stopped")
    assert ("is not heard" in one.text) is dead
    assert seconds == pytest.approx(8.0, abs=0.3)


def test_a_slow_ramp_is_waited_for_as_long_as_it_brakes():
    module = turning(8.0)
    module.parameters["axis0.controller.config.vel_ramp_rate"] = 1.0
    one, sent, seconds = rescue(module, longest=40.0, brake=30.0)
    assert one.ok
    assert 7.0 < seconds < 12.0
    first = next(number for number, (command, _) in enumerate(sent) if command == STATE)
    assert len(sent[:first]) > 200
    assert abs(module.shaft.speed) < 0.01


def test_the_watchdog_process_has_gone_through_all_steps_before_a_program_stops_waiting_for_it():
    """``core.process.launch`` waits 15 s for it, and then kills it."""
    module = turning(15.0)
    module.parameters["axis0.controller.config.vel_ramp_rate"] = 0.5
    one, sent, seconds = rescue(module, {STATE, ESTOP}, longest=15.0)
    assert not one.ok
    assert {command for command, _ in sent} == {MODE, VEL, STATE, ESTOP}
    assert 12.0 < seconds < 12.5


@pytest.mark.parametrize("state", [4, 7])
def test_a_module_that_calibrates_is_switched_off_at_once(state):
    module = Module(5, **OWN)
    module.axis.request(state)
    for number in range(20):
        module.step(number * STEP)
    module.take_frames()
    assert module.energised
    one, sent, seconds = rescue(module)
    assert one.ok
    assert not module.energised
    assert seconds < 1.5
    assert (STATE, 1) in sent


def test_each_escalation_goes_to_the_next_step():
    one = ModuleRescue(SETTINGS)
    one.step(0.0)
    for rung in (RescueStep.IDLE, RescueStep.ESTOP, RescueStep.ESTOP):
        one.escalate(0.1)
        assert one.rung is rung


# -- without counts of the encoder in idle ----------------------------------------------------------------------------


def test_without_counts_a_standstill_that_was_seen_in_closed_loop_counts():
    one, _, _ = rescue(turning(), counts=False)
    assert (one.ok, one.text) == (True, "stands, without power")


def test_without_counts_a_module_that_went_to_idle_in_motion_is_not_confirmed():
    module = turning()
    one, _, _ = rescue(module, {MODE, VEL}, counts=False)
    assert not module.energised
    assert not one.ok
    assert "NOT known" in one.text


def test_without_counts_a_module_in_idle_gets_nothing():
    module = Module(5, **OWN)
    one, sent, _ = rescue(module, after=0.0, counts=False)
    assert (one.ok, one.text) == (True, "is in idle, without power, and was not seen in closed loop")
    assert sent == []


def test_without_counts_a_module_that_is_not_heard_gets_every_step():
    module = turning()
    module.dials.dead = True
    one, sent, _ = rescue(module, counts=False)
    assert not one.ok
    assert {command for command, _ in sent} == {MODE, VEL, STATE, ESTOP}
