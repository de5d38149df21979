"""Procedures that move one module, with random lost frames, interrupts and faults: each ends and reports the module's state."""

from __future__ import annotations

import random

import pytest

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.calibration import Calibration, CalibrationKind
from axisbus.drives.gim6010.direct_motion import HeartbeatMonitor, PowerOff
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.drives.gim6010.tuning import Gains, Loop, ModuleTrial, ModuleTuning
from axisbus.errors import ArgumentError
from kit.module_dialogue import play
from kit.sim.can_simple_module import ESTOP, SET_STATE, Bench

DIALOGUES = {
    "calibration": lambda: Calibration(5, CalibrationKind.FULL),
    "position": lambda: ModuleTuning(
        ModuleTrial(5, Loop.POSITION, 1.0, 0.6, velocity=10.0, acceleration=80.0), Gains(15.0)
    ),
    "velocity": lambda: ModuleTuning(ModuleTrial(5, Loop.VELOCITY, 3.0, 0.6), Gains()),
}
FAULTS = (
    lambda one: setattr(one.module.dials, "encoder_error", 4),
    lambda one: one.module.restart(),
    lambda one: one.order(SET_STATE, 8),
    lambda one: one.order(ESTOP),
    lambda _: None,
)
JOLTS = (  # after these the plant alone is not smooth
    lambda one: setattr(one.module.dials, "blocked", True),
    lambda one: setattr(one.module.dials, "encoder_frozen", True),
)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", DIALOGUES)
def test_each_dialogue_ends_and_reports_the_truth_under_random_losses_and_faults(name, seed):
    chance = random.Random(f"{name} {seed}")
    one = Bench(Module(5, vel_ramp_rate=20.0, dials=ModuleFaults(calibration_time=0.2, restart_time=0.3)))
    one.run(0.3)
    dialogue, part = DIALOGUES[name](), chance.choice([0.0, 0.02, 0.2])
    moments = sorted(chance.uniform(1.5, 4.5) for _ in range(2))
    fault = chance.choice(FAULTS + JOLTS)
    acts = [fault, lambda _: dialogue.interrupt("Ctrl-C") if chance.random() < 0.5 else None]

    def happen(wire):
        if moments and wire.now >= moments[0]:
            moments.pop(0)
            acts.pop(0)(wire)

    sent = play(dialogue, one, at=happen, lose=lambda *_: chance.random() < part, step=0.002, longest=60.0)
    assert dialogue.left
    states = [each.data[0] for each in sent if each.command == SET_STATE]
    assert [state for state in states if state != 1] == [state for state in states[:1] if state != 1]
    if dialogue.confirmed:
        assert not one.module.energised
    else:
        assert "NOT CONFIRMED" in dialogue.left
    if fault not in JOLTS:
        one.must_be_smooth()


def beat(time, state, life, error=0):
    return CanFrame(time, 5 << 5 | 1, error.to_bytes(4, "little") + bytes([state, 0, 0, life]))


def test_a_pulse():
    pulse = HeartbeatMonitor(5)
    assert (pulse.last, pulse.period, pulse.is_silent(0.0)) == (None, 0.0, True)
    for number in range(5):
        assert pulse.take(beat(number * 0.2, 1, number))
    assert pulse.period == pytest.approx(0.2)
    assert not pulse.take(CanFrame(1.0, 6 << 5 | 1, bytes(8)))
    assert not pulse.take(CanFrame(1.0, 5 << 5 | 1, bytes(7)))
    assert not pulse.take(CanFrame(1.0, 5 << 5 | 1, bytes(8), extended=True))
    assert not pulse.is_silent(1.79)
    assert pulse.is_silent(1.81)  # five periods
    assert pulse.against(0.9) == ""
    pulse.settle()
    pulse.take(beat(1.0, 1, 200))
    assert pulse.restarted
    assert "restarted" in pulse.lost(1.0)
    pulse.take(beat(1.2, 8, 201, 0x4000))
    assert "closed loop" in pulse.against(1.2)
    assert any("ESTOP_REQUESTED" in each for each in pulse.errors())
    with pytest.raises(ArgumentError):
        HeartbeatMonitor(64)


def test_the_power_is_switched_off_by_idle_then_estop():
    """Idle for 1.5 s and two periods, then ESTOP as long, then the unknown state is reported."""
    pulse = HeartbeatMonitor(5)
    for number in range(5):
        pulse.take(beat(number * 0.1, 8, number))
    going, sent, now = PowerOff(pulse), [], 0.4
    while not going.over:
        frame = going.step(now)
        if frame is not None:
            sent.append((round(now, 3), frame.can_id & 0x1F))
        now += 0.005
    idle = [time for time, command in sent if command == SET_STATE]
    estop = [time for time, command in sent if command == ESTOP]
    assert idle[0] == 0.4
    assert idle[1] - idle[0] == pytest.approx(0.05, abs=0.006)
    assert estop[0] - idle[0] == pytest.approx(1.7, abs=0.06)
    assert now - estop[0] == pytest.approx(1.7, abs=0.06)
    assert len(idle) + len(estop) == len(sent)
    assert (going.confirmed, "is not heard" in going.left) == (False, True)
