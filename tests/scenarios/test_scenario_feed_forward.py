"""Feed-forward: a drive gets velocity and torque of each set-point, and offsets of 0 while the master does not control it."""

from __future__ import annotations

import random
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import pytest

from axisbus import eds
from axisbus.eds.builtin import resolve
from axisbus.errors import AdapterError, ArgumentError, AxisbusError, BootError, ConfigError, LimitError
from axisbus.motion.states import AxisState
from axisbus.sim.build import device_from_eds, motor_from_eds
from kit.cell import GENERIC, Cell, Stage
from kit.plant_probe import ENABLED, OFF
from kit.sim.sync_values import CSP, CSV, Held, Witness

RATED = "rated_torque = 10.0\nmax_torque = 8.0\n"
PER_NM = 100.0  # ‰ of the rated torque in one N·m
SCALE, PERIOD = 100.0, 0.01  # increments per degree, seconds of the scan
RAMP = 0.2  # seconds in which the constant torque comes
HALT = 0x0100


def forward(velocity: bool = True, inertia: float | None = 0.002, torque: float | None = None) -> str:
    """The table of the cell file's only axis."""
    lines = ["[axes.x.feed_forward]", f"velocity = {str(velocity).lower()}"]
    lines += [] if inertia is None else [f"inertia = {inertia}"]
    lines += [] if torque is None else [f"torque_offset = {torque}"]
    return "\n".join(lines) + "\n"


def made(
    stage: Stage, more: str, motor: dict[str, float] | None = None, **changes: str
) -> tuple[Cell, Witness]:
    """A simulated cell with one axis with feed-forward, and the values of its drive at each SYNC."""

    def devices() -> dict[int, object]:
        model = eds.load(resolve(GENERIC, stage.folder))
        return {1: device_from_eds(model, 1, replace(motor_from_eds(model), **(motor or {})))}

    axis = RATED + changes.pop("axis", "")
    cell = stage.simulated("x", axis=axis, more=more, devices=devices, **changes)  # type: ignore[arg-type]
    return cell, Witness(cell.drive())


def path(distance: float, time: float):
    """A way of one second order: its acceleration is even in each half, which can be said by hand."""

    def place(t: float) -> float:
        half, t = time / 2, min(max(t, 0.0), time)
        if t <= half:
            return 2.0 * distance * (t / time) ** 2
        return distance - 2.0 * distance * ((time - t) / time) ** 2

    return place


def follow(cell: Cell, distance: float, time: float):
    start = cell.x.position or 0.0
    way = path(distance, time)
    return cell.x.follow(lambda t: start + way(t), duration=time)


def velocities(held: list[Held]) -> list[tuple[Held, float]]:
    """Each SYNC of csp with the velocity of its target, in increments/s, by the targets alone."""
    return [
        (after, (after.position - before.position) / PERIOD)
        for before, after in pairwise(held)
        if before.mode == after.mode == CSP and before.stage == after.stage == ENABLED
    ]


# -- sent offsets --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("invert", ["", 'invert = "master"\n', 'invert = "drive"\n'])
def test_the_offsets_are_the_velocity_and_the_torque_of_each_target(scenario, invert):
    cell, witness = made(scenario, forward(torque=0.5), axis=invert)
    cell.enabled()
    moment = cell.moment()
    follow(cell, 60.0, 1.2).wait(5)
    led = velocities(witness.since(moment))
    fast = max(abs(velocity) for _, velocity in led)
    assert fast == pytest.approx(100.0 * SCALE, rel=0.03)  # 2 x 60 deg in 1.2 s
    for (
        held,
        velocity,
    ) in led:  # a target is rounded: by that its velocity is off by one increment in a period
        assert held.velocity_offset == pytest.approx(velocity, abs=1.0 / PERIOD + 1.0)
    turned = -1 if "master" in invert else 1
    up = (
        turned * 0.002 * 60.0 * 4 / 1.2**2 * PER_NM
    )  # 4 s / T² in the first half, with the other sign in the second
    constant = turned * 0.5 * PER_NM
    began = next(held.time for held, velocity in led if velocity)
    halves = [held.torque_offset for held, _ in led if began + RAMP + 0.02 < held.time < began + 0.58]
    second = [held.torque_offset for held, _ in led if began + 0.62 < held.time < began + 1.18]
    assert halves
    assert second
    assert set(halves) <= {round(constant + up) + off for off in (-1, 0, 1)}
    assert set(second) <= {round(constant - up) + off for off in (-1, 0, 1)}


def test_only_the_configured_offsets_are_sent(scenario):
    for more, expected in ((forward(inertia=None), (True, False)), (forward(velocity=False), (False, True))):
        cell, witness = made(scenario, more)
        cell.enabled()
        follow(cell, 60.0, 1.2).wait(5)
        sent = any(h.velocity_offset for h in witness.held), any(h.torque_offset for h in witness.held)
        assert sent == expected


def test_a_drive_that_turns_velocities_alone_gets_the_other_sign(scenario):
    cell, witness = made(scenario, forward() + '[axes.x.objects]\n"607E" = 0x40\n')
    cell.enabled()
    moment = cell.moment()
    follow(cell, 60.0, 1.2).wait(5)
    led = [(held, velocity) for held, velocity in velocities(witness.since(moment)) if abs(velocity) > 1000.0]
    assert led
    for held, velocity in led:
        assert held.velocity_offset == pytest.approx(-velocity, abs=1.0 / PERIOD + 1.0)
    assert lag_of(cell, follow, 60.0) < 1.0  # else it would be twice that without


def lag_of(cell: Cell, move, distance: float) -> float:
    """The largest lag of the motor behind its demand during a move, in increments."""
    moment = cell.moment()
    move(cell, distance, 1.2).wait(5)
    record = cell.record().since(moment)
    return max(abs(sample.demand - sample.position) for sample in record) * SCALE


def test_the_drive_follows_closer_by_its_velocity(scenario):
    motor = {"lag": 0.02}
    without, _ = made(scenario, "", motor)
    assert lag_of(without.enabled(), follow, 60.0) == pytest.approx(0.02 * 100.0 * SCALE, rel=0.05)
    cell, _ = made(scenario, forward(inertia=None), motor)
    assert lag_of(cell.enabled(), follow, 60.0) < 5.0


def test_a_compliant_drive_follows_closer_by_its_torque(scenario):
    """The spring gives 10 ‰ per increment; the load takes 1000 ‰ for 200 000 increments/s²."""
    motor = {"stiffness": 10.0, "damping": 0.7, "rated_acceleration": 2.0e5, "friction": 0.0}
    without, _ = made(scenario, "", motor)
    acceleration = 4 * 60.0 / 1.2**2  # deg/s²
    torque = acceleration * SCALE / 200.0  # ‰
    assert lag_of(without.enabled(), follow, 60.0) > torque / 10.0
    inertia = SCALE / 200.0 / PER_NM  # N·m per deg/s², by the two lines above
    cell, _ = made(scenario, forward(velocity=False, inertia=inertia), motor)
    cell.enabled()
    moment = cell.moment()
    follow(cell, 60.0, 1.2).wait(5)
    record = [
        s for s in cell.record().since(moment) if 0.4 < s.time - moment < 0.6 or 1.0 < s.time - moment < 1.1
    ]
    assert max(abs(s.demand - s.position) for s in record) * SCALE < 0.2 * torque / 10.0


def test_a_weight_does_not_pull_the_axis_down(scenario):
    motor = {"stiffness": 10.0, "damping": 0.7, "load": 100.0, "friction": 150.0}
    more = forward(velocity=False, inertia=None, torque=1.0)
    cell, _ = made(scenario, more, motor, axis="standstill_window = 1.0\n")
    cell.enabled()
    follow(cell, 5.0, 1.0).wait(5)  # it is in csp from here on
    cell.run(0.5)
    sample = cell.sample()
    assert (sample.demand - sample.position) * SCALE == pytest.approx(0.0, abs=0.5)  # else 10 increments


def test_in_csv_the_torque_alone_is_sent(scenario):
    cell, witness = made(scenario, forward(torque=0.5))
    cell.enabled()
    moment = cell.moment()
    cell.x.cyclic_velocity(100.0, acceleration=200.0).wait(5)
    ramp = [h for h in witness.since(moment) if h.mode == CSV and 500 < h.speed < 9500]
    assert ramp
    ready = [h.torque_offset for h in ramp if h.time > ramp[0].time + RAMP]
    assert set(ready) <= {round(0.5 * PER_NM + 0.002 * 200.0 * PER_NM) + off for off in (-1, 0, 1)}
    assert not any(h.velocity_offset for h in witness.held)
    cell.run(0.5)
    assert witness.held[-1].torque_offset == 50


# -- when nothing is sent ------------------------------------------------------------------------------------------------


def test_the_constant_torque_is_ramped_and_sent_in_csp_only(scenario):
    cell, witness = made(scenario, forward(velocity=False, inertia=None, torque=4.0))
    cell.enabled()
    cell.run(0.5)
    assert not any(
        h.torque_offset for h in witness.held
    )  # it is at standstill in pp, in which a drive adds nothing
    follow(cell, 1.0, 0.5).wait(5)
    steps = [abs(b.torque_offset - a.torque_offset) for a, b in pairwise(witness.held)]
    assert max(steps) <= 400 * PERIOD / RAMP + 1
    assert witness.held[-1].torque_offset == 400
    assert not any(h.torque_offset for h in witness.held if h.mode != CSP)


def test_the_torque_offset_is_changed_at_run_time(scenario):
    cell, witness = made(scenario, forward(velocity=False, inertia=None, torque=0.0))
    cell.enabled()
    follow(cell, 1.0, 0.5).wait(5)
    cell.x.set_torque_offset(-2.5).wait(1)
    cell.run(0.5)
    assert witness.held[-1].torque_offset == -250
    with pytest.raises(LimitError, match="max_torque"):
        cell.x.set_torque_offset(8.5)
    for wrong in (float("nan"), "much"):
        with pytest.raises(ArgumentError):
            cell.x.set_torque_offset(wrong)  # type: ignore[arg-type]
    cell.run(0.1)
    assert witness.held[-1].torque_offset == -250
    cell.x.set_torque_offset(0.0).wait(1)
    cell.run(0.5)
    assert witness.held[-1].torque_offset == 0


def test_a_torque_offset_that_is_not_configured_cannot_be_set(scenario):
    cell, _ = made(scenario, forward(inertia=None))
    with pytest.raises(ArgumentError, match="is not sent"):
        cell.x.set_torque_offset(1.0)


def test_the_torque_offset_is_limited_to_the_maximum_torque(scenario):
    cell, witness = made(scenario, forward(inertia=0.1, torque=2.0))
    cell.enabled()
    follow(cell, 60.0, 1.2).wait(5)
    torques = [h.torque_offset for h in witness.held]
    assert max(torques) == 800  # 2 + 0.1 x 166 N·m
    assert min(torques) == -800


STOPS = {
    "quick stop": lambda cell: cell.x.quick_stop(),
    "stop": lambda cell: cell.x.stop(),
    "disable": lambda cell: cell.x.disable(),
    "coast": lambda cell: cell.x.disable(coast=True),
    "fault": lambda cell: cell.drive().fault(0x7500),
    "close": lambda cell: cell.machine.close(),
    "ctrl-c": lambda cell: cell.ctrl_c(10.0),
}


@pytest.mark.parametrize("how", STOPS)
def test_a_stop_leaves_no_offset(scenario, how):
    cell, witness = made(scenario, forward(torque=2.0))
    cell.enabled()
    follow(cell, 300.0, 6.0)
    cell.run(2.0)
    assert witness.held[-1].velocity_offset > 1000
    assert witness.held[-1].torque_offset > 150
    STOPS[how](cell)
    cell.run(1.0)
    drive = cell.drive()
    assert (drive.velocity_offset, drive.torque_offset) == (0, 0)
    for before, held in pairwise(witness.held):
        if held.stage != ENABLED:  # 2 SYNCs later the master knows, and its 0 comes with the next
            late = held.time - last_enabled(witness.held, before)
            assert late < 3.5 * PERIOD or (held.velocity_offset, held.torque_offset) == (0, 0)


def last_enabled(held: list[Held], until: Held) -> float:
    return max((h.time for h in held if h.stage == ENABLED and h.time <= until.time), default=-1.0)


def test_a_halt_brakes_with_the_velocity_offset_of_its_path_and_the_torque_offset_stays(scenario):
    cell, witness = made(scenario, forward(torque=2.0))
    cell.enabled()
    follow(cell, 300.0, 6.0)
    cell.run(2.0)
    moment = cell.moment()
    cell.x.halt().wait(5)
    for held, velocity in velocities(witness.since(moment)):
        assert held.velocity_offset == pytest.approx(velocity, abs=1.0 / PERIOD + 1.0)
    cell.run(0.3)
    assert (witness.held[-1].velocity_offset, witness.held[-1].torque_offset) == (0, 200)
    moment = cell.moment()
    cell.x.stop().wait(5)  # but a stop takes it away, gently
    cell.run(0.5)
    assert cell.x.state is AxisState.STOPPING
    assert cell.stage() == ENABLED
    assert witness.held[-1].torque_offset == 0
    steps = [abs(b.torque_offset - a.torque_offset) for a, b in pairwise(witness.since(moment))]
    assert max(steps) <= 200 * PERIOD / RAMP + 1


def test_the_scan_that_dies_sends_0(scenario):
    cell, witness = made(scenario, forward(torque=2.0))
    cell.enabled()
    follow(cell, 300.0, 6.0)
    cell.run(2.0)
    assert witness.held[-1].velocity_offset > 1000
    cell.faults.commit = AdapterError("the adapter is gone")
    with suppress(AxisbusError):
        cell.run(0.05)
    assert not cell.scan_runs
    assert (witness.held[-1].velocity_offset, witness.held[-1].torque_offset) == (0, 0)


def test_a_drive_that_was_lost_gets_0_before_it_is_enabled_again(scenario):
    """It does not detect the loss of the master, and so keeps its values."""
    stop = 'connection_loss = "nothing"\ncommunication_error = "no-change"'
    cell, witness = made(scenario, forward(torque=2.0), stop=stop)
    cell.enabled()
    follow(cell, 300.0, 6.0)
    cell.run(2.0)
    device = cell.device()
    device.dials.dead = True  # the cable
    cell.run(1.0)
    assert cell.drive().torque_offset > 150  # it cannot be reached
    device.dials.dead = False
    cell.run(0.1)
    assert (cell.drive().velocity_offset, cell.drive().torque_offset) == (0, 0)
    cell.run(2.0)
    cell.x.reset().wait(5)
    moment = cell.moment()
    cell.x.enable().wait(5)
    again = witness.since(moment)
    assert any(h.stage == ENABLED for h in again)
    assert not any(h.velocity_offset or h.torque_offset for h in again)


def test_offsets_of_another_program_are_cleared_before_the_drive_is_enabled(scenario):
    cell, witness = made(scenario, forward(torque=2.0))
    drive = cell.drive()
    drive.velocity_offset, drive.torque_offset = 5000, -300
    cell.run(0.5)
    assert (drive.velocity_offset, drive.torque_offset) == (5000, -300)  # no command was given
    cell.enabled()
    cell.run(0.1)
    first = next(number for number, h in enumerate(witness.held) if h.stage == ENABLED)
    assert not any(h.velocity_offset or h.torque_offset for h in witness.held[first - 1 :])


def test_a_drive_that_was_found_enabled_keeps_its_offsets_until_it_has_left_its_mode(scenario):
    def found(cell: Cell) -> None:
        drive = cell.drive()
        drive.velocity_offset, drive.torque_offset = 0, 300

    cell, witness = made(scenario, forward(torque=2.0))
    drive = cell.drive()
    drive.start_enabled(CSP)
    found(cell)
    cell.run(0.5)
    assert drive.torque_offset == 300  # nothing was asked
    moment = cell.moment()
    cell.x.enable().wait(5)
    for held in witness.since(moment):
        assert held.torque_offset == (300 if held.mode == CSP else held.torque_offset)
    assert witness.held[-1].torque_offset == 0


# -- random plays ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(8))
def test_random_plays_hold_the_rules_in_every_sync(scenario, seed):
    """Whatever is asked: no offset without power or outside its mode, and in csp the velocity of the targets themselves."""
    rng = random.Random(seed)
    cell, witness = made(scenario, forward(torque=rng.choice([0.0, 2.0, -3.0])), {"lag": 0.01})
    plays = (
        lambda: cell.x.enable(),
        lambda: cell.x.enable(),
        lambda: follow(cell, rng.uniform(-80, 80), rng.uniform(0.8, 2.0)),
        lambda: follow(cell, rng.uniform(-80, 80), rng.uniform(0.8, 2.0)),
        lambda: cell.x.move_relative(rng.uniform(-60, 60)),
        lambda: cell.x.move_relative(rng.uniform(-60, 60), jerk=3000.0),
        lambda: cell.x.move_velocity(rng.uniform(-90, 90)),
        lambda: cell.x.cyclic_velocity(rng.uniform(-90, 90)),
        lambda: cell.x.move_superimposed(rng.uniform(-5, 5)),
        lambda: cell.x.set_override(rng.choice([0.0, 0.5, 1.0, 1.3])),
        lambda: cell.x.set_torque_offset(rng.uniform(-5, 5)),
        lambda: cell.x.halt(),
        lambda: cell.x.stop(),
        lambda: cell.x.release(),
        lambda: cell.x.quick_stop(),
        lambda: cell.x.disable(),
        lambda: cell.x.reset(),
        lambda: cell.drive().fault(0x7500),
    )
    for _ in range(60):
        handle = rng.choice(plays)()
        cell.run(rng.choice([0.02, 0.1, 0.4, 1.0]))
        if handle is not None and not handle.busy:
            handle.exception()
    must_hold(witness.held)
    cell.machine.close()
    cell.run(0.2)
    assert cell.stage() in OFF
    assert (witness.held[-1].velocity_offset, witness.held[-1].torque_offset) == (0, 0)


def must_hold(held: list[Held]) -> None:
    for number in range(4, len(held)):
        before, now = held[number - 1], held[number]
        assert abs(now.torque_offset) <= 800
        recent = held[number - 3 : number + 1]
        if all(one.stage != ENABLED for one in recent):
            assert (now.velocity_offset, now.torque_offset) == (0, 0), now
        if all(one.mode != CSP for one in recent):
            assert now.velocity_offset == 0, now
        if all(one.mode not in (CSP, CSV) for one in recent):
            assert now.torque_offset == 0, now
        led = all(one.stage == ENABLED and one.mode == CSP and not one.word & HALT for one in recent)
        if led and now.velocity_offset:
            velocity = (now.position - before.position) / PERIOD
            assert now.velocity_offset == pytest.approx(velocity, abs=1.0 / PERIOD + 1.0), now


def test_a_bus_without_sync_is_refused(scenario):
    with pytest.raises(ConfigError, match="60B1h"):
        made(scenario, forward(), bus="sync = false")


def test_a_drive_without_the_object_is_refused_at_boot(scenario):
    """By its file it has the object."""
    text = resolve(GENERIC, scenario.folder).read_text(encoding="utf-8").replace("60B1", "5FB1")
    (scenario.folder / "other.eds").write_text(text, encoding="utf-8")
    other = device_from_eds(eds.load(scenario.folder / "other.eds"), 1)
    with pytest.raises(BootError, match="60B1h") as caught:
        scenario.simulated("x", axis=RATED, more=forward(), devices=lambda: {1: other})
    assert "none of its RPDOs contains it" in caught.value.observed
