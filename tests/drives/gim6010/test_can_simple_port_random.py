"""Random commands, faults and lost frames for a module as an axis: it is smooth, it stops, and no wrong frame is sent."""

from __future__ import annotations

import random
from contextlib import suppress
from dataclasses import replace

import pytest

from axisbus.drives.gim6010.sim.constants import Firmware
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import AxisbusError
from kit.can_simple.rig import OWN, SETTINGS, Rig, judge, rig

HARDEST = 150.0  # turns/s²
FIRMWARES = [Firmware(0, 5, 11), Firmware(0, 5, 12), Firmware(0, 5, 13), Firmware(0, 6, 5)]

COMMANDS = {
    "enable": lambda axis, _: axis.enable(),
    "disable": lambda axis, _: axis.disable(),
    "home": lambda axis, _: axis.home(),
    "absolute": lambda axis, dice: axis.move_absolute(
        dice.uniform(-300, 300), velocity=dice.choice([30, 180, 600])
    ),
    "relative": lambda axis, dice: axis.move_relative(dice.uniform(-90, 90)),
    "velocity": lambda axis, dice: axis.move_velocity(dice.choice([-360, -45, 45, 360])),
    "torque": lambda axis, dice: axis.torque_control(dice.uniform(-0.5, 0.5)),
    "halt": lambda axis, _: axis.halt(),
    "stop": lambda axis, _: axis.stop(),
    "release": lambda axis, _: axis.release(),
    "quick": lambda axis, _: axis.quick_stop(),
    "reset": lambda axis, _: axis.reset(),
    "override": lambda axis, dice: axis.set_override(dice.choice([0.0, 0.3, 1.0, 1.2])),
}
MISHAPS = {
    "fault": lambda r: setattr(r.module.dials, "motor_error", 0x10000),
    "healed": lambda r: setattr(r.module.dials, "motor_error", 0),
    "idle": lambda r: r.module.axis.request(1),
    "beats": lambda r: setattr(r.module.dials, "heartbeat_stops", True),
    "beats again": lambda r: setattr(r.module.dials, "heartbeat_stops", False),
    "estimates": lambda r: setattr(r.module.dials, "estimates_stop", True),
    "estimates again": lambda r: setattr(r.module.dials, "estimates_stop", False),
    "undervoltage": lambda r: setattr(r.module.dials, "bus_voltage", 9.0),
    "voltage": lambda r: setattr(r.module.dials, "bus_voltage", 24.0),
}


def play(seed: int, *, mishaps: bool, loss: float) -> Rig:
    dice = random.Random(seed)
    dials = ModuleFaults(get_error_answered=dice.random() < 0.5, runaway_after=0.3)
    holds = dice.random() < 0.5
    settings = replace(SETTINGS, quick_stop_holds=holds, filter_bandwidth=dice.choice([None, 50.0]))
    module = Module(5, firmware=dice.choice(FIRMWARES), dials=dials, input_filter_bandwidth=50.0, **OWN)
    r = rig(settings=settings, module=module, quick_stop_holds=holds)
    r.cycle.lose = lambda *_: dice.random() < loss
    with suppress(AxisbusError):
        r.axis.enable().wait(3)
    for _ in range(30):
        name = dice.choice(list(COMMANDS))
        with suppress(AxisbusError):
            COMMANDS[name](r.axis, dice)
        if mishaps and dice.random() < 0.2:
            MISHAPS[dice.choice(list(MISHAPS))](r)
        r.run(dice.choice([0.01, 0.03, 0.1, 0.4, 1.0]))
    return r


def must_stop(r: Rig) -> None:
    r.scan.request_stop("the program ends")
    r.run(12.0)
    if r.core.touched:
        assert abs(r.module.shaft.speed) < 0.02
    place = r.module.position
    r.run(1.0)
    assert r.module.position == pytest.approx(place, abs=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_random_commands_move_smoothly_and_end_at_standstill(seed):
    r = play(seed, mishaps=False, loss=0.0)
    judge(r)
    r.must_be_smooth(HARDEST)
    must_stop(r)
    assert not r.module.axis.faulty
    judge(r)


@pytest.mark.parametrize("seed", range(100, 106))
def test_random_faults_end_at_standstill(seed):
    r = play(seed, mishaps=True, loss=0.0)
    judge(r)
    r.must_be_smooth(HARDEST)
    must_stop(r)
    judge(r)


@pytest.mark.parametrize("seed", range(200, 204))
def test_random_frame_losses_end_at_standstill(seed):
    r = play(seed, mishaps=True, loss=0.05)
    r.cycle.lose = lambda *_: False
    must_stop(r)


@pytest.mark.parametrize("seed", range(300, 305))
def test_whenever_the_scan_dies_the_last_frames_stop_the_module(seed):
    r = play(seed, mishaps=False, loss=0.0)
    led = r.module.energised
    r.cycle.quick_stop_all()
    r.cycle.wait_until(r.now + 2.0)
    assert abs(r.module.shaft.speed) < 0.02 or not led
    place = r.module.position
    r.cycle.wait_until(r.now + 3.0)
    assert r.module.position == pytest.approx(place, abs=0.02)


def test_the_end_of_a_program_switches_the_module_off():
    r = rig().enabled()
    r.axis.move_velocity(90.0).wait(5)
    r.scan.request_stop("the program ends")
    r.run(3.0)
    assert not r.module.energised
    assert abs(r.module.shaft.speed) < 0.01
