"""A module is stopped without the scan that commanded it: braked, switched off, at last by ESTOP, until standstill is seen."""

from __future__ import annotations

from dataclasses import replace

import pytest

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.port.stop_without_scan import ModuleRescue
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


def rescue(module: Module, lost: set[int] = frozenset(), *, holds: bool = False, after: float = 1.0):
    """Let it be stopped; return the rescue, the commands that were sent, and the seconds that it took."""
    one, sent, now = ModuleRescue(replace(SETTINGS, quick_stop_holds=holds)), [], after
    while not one.text:
        assert now - after < 12.0
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
