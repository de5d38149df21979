"""Moves with a limit of jerk: by the drive if it has one, otherwise streamed by the master; a halt never waits for it."""

from __future__ import annotations

import math
import random

import pytest

from axisbus.eds.builtin import resolve
from axisbus.errors import ArgumentError, DriveError, Interrupted, LimitError, StateError
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.dictionary import Dictionary
from kit.cell import GENERIC, cell_text
from kit.scenarios.jerk_limited import JERK, NEAR, WITHOUT_JERK, ComputedMotion, Demand, soft, without_jerk
from kit.virtual_axis import virtual

TYPE, LIMIT = 0x6086, 0x60A4
LINEAR, LIMITED, JERK_FREE = 0, 3, 2


def of(cell, index, subindex=0):
    return cell.device().read(index, subindex)


# -- by the drive --------------------------------------------------------------------------------------------------------


def test_a_drive_with_a_profile_jerk_limits_it_itself(scenario):
    cell = scenario.simulated("x").enabled()
    demand = Demand(cell)
    begun = cell.now
    assert cell.end_of(cell.x.move_absolute(100.0)) is None
    at_once = cell.now - begun
    assert demand.worst(3) > 3 * JERK
    demand.forget()
    begun = cell.now
    assert cell.end_of(cell.x.move_absolute(0.0, jerk=JERK)) is None
    assert (of(cell, TYPE), of(cell, LIMIT, 1)) == (LIMITED, JERK * 100)
    # A mean of ramps: the full jerk occurs only where one ramp follows the other.
    assert demand.worst(3) == pytest.approx(0.5 * JERK, rel=1e-3)
    assert 450.0 < demand.worst(2) <= 500.5
    assert cell.now - begun == pytest.approx(at_once + 2 * 500.0 / JERK, abs=0.05)
    assert cell.where("x") == pytest.approx(0.0, abs=NEAR)
    demand.forget()
    assert cell.end_of(cell.x.move_absolute(20.0, velocity=300.0, jerk=JERK)) is None
    assert demand.worst(3) == pytest.approx(JERK, rel=1e-3)


def test_the_type_of_profile_is_restored_for_moves_without_jerk(scenario):
    cell = scenario.simulated("x").enabled()
    cell.end_of(cell.x.move_absolute(10.0, jerk=JERK))
    assert of(cell, TYPE) == LIMITED
    cell.end_of(cell.x.move_absolute(20.0))
    assert of(cell, TYPE) == LINEAR
    cell.end_of(cell.x.move_relative(10.0, jerk=JERK))
    cell.end_of(cell.x.move_velocity(10.0))
    assert of(cell, TYPE) == LINEAR


def types_up_to(scenario, highest):
    """A cell whose drive takes no more than ``highest`` in 6086h, enabled."""
    text = resolve(GENERIC, scenario.folder).read_text(encoding="utf-8")
    file = scenario.folder / "drive.eds"
    file.write_text(text.replace("LowLimit=0\nHighLimit=3\n", f"LowLimit=0\nHighLimit={highest}\n"))
    return scenario.simulated("x", eds="drive.eds").enabled()


def test_a_drive_with_another_number_for_the_jerk_free_profile_gets_that_number(scenario):
    cell = types_up_to(scenario, JERK_FREE)
    demand = Demand(cell)
    assert cell.end_of(cell.x.move_absolute(50.0, jerk=JERK)) is None
    assert of(cell, TYPE) == JERK_FREE
    assert demand.worst(3) <= JERK * 1.001


def test_a_drive_that_refuses_both_is_reported_with_its_abort_code_and_does_not_move(scenario):
    cell = types_up_to(scenario, 1)
    error = cell.failure_of(cell.x.move_absolute(50.0, jerk=JERK))
    assert isinstance(error, DriveError)
    assert "6086h" in str(error)
    assert "abort code" in str(error)
    assert cell.where("x") == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("index", [TYPE, LIMIT])
def test_a_drive_that_does_not_store_the_written_jerk_is_reported_and_does_not_move(
    scenario, monkeypatch, index
):
    cell = scenario.simulated("x").enabled()
    plain = Dictionary.upload

    def upload(self, at: int, sub: int) -> bytes:
        data = plain(self, at, sub)
        return bytes(len(data)) if at == index else data

    monkeypatch.setattr(Dictionary, "upload", upload)
    error = cell.failure_of(cell.x.move_absolute(10.0, jerk=JERK))
    assert isinstance(error, DriveError)
    assert "it is 0 after" in str(error)
    assert cell.where("x") == pytest.approx(0.0, abs=0.01)


def test_a_default_limits_all_moves_and_one_of_them_may_be_without(scenario):
    cell = soft(scenario)
    demand = Demand(cell)
    cell.end_of(cell.x.move_absolute(50.0))
    assert demand.worst(3) <= JERK * 1.001
    demand.forget()
    cell.end_of(cell.x.move_absolute(0.0, jerk=math.inf))
    assert demand.worst(3) > 3 * JERK


@pytest.mark.parametrize("eds", [GENERIC, WITHOUT_JERK])
def test_a_default_of_jerk_changes_no_halt_and_no_stop(scenario, eds):
    ways = {}
    without_jerk(scenario)
    for kind in ("plain", "soft"):
        for call in ("halt", "stop", "quick_stop"):
            cell = soft(scenario, eds) if kind == "soft" else scenario.simulated("x", eds=eds).enabled()
            cell.x.move_absolute(500.0)
            cell.run(1.5)
            assert cell.x.velocity == pytest.approx(100.0, abs=3.0)
            begun = cell.where("x")
            assert cell.end_of(getattr(cell.x, call)()) is None
            ways[kind, call] = cell.where("x") - begun
    for call in ("halt", "stop", "quick_stop"):
        assert ways["soft", call] == pytest.approx(ways["plain", call], abs=1.5)


def test_an_override_of_a_move_with_jerk_keeps_its_jerk(scenario):
    cell = soft(scenario)
    demand = Demand(cell)
    handle = cell.x.move_absolute(300.0)
    cell.run(0.8)
    for factor in (0.3, 1.5, 0.5):
        cell.x.set_override(factor).wait()
        cell.run(0.7)
        assert cell.x.velocity == pytest.approx(100.0 * factor, abs=2.0)
    cell.x.set_override(1.0).wait()
    assert cell.end_of(handle) is None
    assert demand.worst(3) <= JERK * 1.001
    assert cell.where("x") == pytest.approx(300.0, abs=NEAR)


# -- by the master -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("eds", [WITHOUT_JERK])
def test_without_a_profile_jerk_the_master_controls_the_move(scenario, eds):
    cell = soft(scenario, eds)
    led = ComputedMotion(cell)
    handle = cell.x.move_absolute(100.0)
    cell.run(0.8)
    assert cell.x.snapshot.mode == 8
    assert cell.end_of(handle) is None
    assert 0.45 * JERK < led.worst(3) <= JERK * 1.001
    assert 450.0 < led.worst(2) <= 500.5
    assert cell.where("x") == pytest.approx(100.0, abs=NEAR)
    assert cell.x.state is AxisState.STANDSTILL
    assert cell.end_of(cell.x.move_relative(-30.0)) is None
    assert cell.where("x") == pytest.approx(70.0, abs=NEAR)


def test_a_move_of_the_master_is_overridden_and_held_and_keeps_its_jerk(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    handle = cell.x.move_absolute(300.0, timeout=8.0)
    cell.run(0.8)
    for factor in (0.3, 0.0, 1.5, 0.5):
        cell.x.set_override(factor).wait()
        cell.run(0.8)
        assert cell.x.velocity == pytest.approx(100.0 * factor, abs=2.0)
        if not factor:
            cell.run(20.0)
    assert cell.end_of(handle) is None
    assert led.worst(3) <= JERK * 1.001
    assert cell.where("x") == pytest.approx(300.0, abs=NEAR)


@pytest.mark.parametrize("moment", [0.0, 0.02, 0.15, 0.5, 1.0])
@pytest.mark.parametrize("target", [300.0, 40.0, -50.0])
def test_a_move_of_the_master_takes_over_from_another_without_a_jump(scenario, moment, target):
    """During acceleration or later, farther, back, and to a target before which it cannot stop."""
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    first = cell.x.move_absolute(200.0)
    cell.run(moment)
    begun = cell.x.velocity
    second = cell.x.move_absolute(target)
    cell.run(0.1)
    assert isinstance(first.exception(), Interrupted)
    assert moment < 0.3 or cell.x.velocity > 0.5 * begun
    assert cell.end_of(second) is None
    assert cell.where("x") == pytest.approx(target, abs=NEAR)
    assert led.worst(3) <= JERK * 1.001
    assert led.worst(2) <= 500.0 * 1.001


def test_a_move_of_the_master_with_another_jerk_takes_over_velocity_and_acceleration(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    cell.x.move_absolute(200.0)
    cell.run(0.3)
    assert cell.end_of(cell.x.move_absolute(-40.0, jerk=2.0 * JERK)) is None
    assert led.worst(2) <= 500.0 * 1.001
    assert led.worst(3) <= 2.0 * JERK * 1.001


@pytest.mark.parametrize("moment", [0.15, 0.2, 0.3, 0.9, 1.35])
@pytest.mark.parametrize("before", [1000.0, 200.0])
def test_a_move_of_the_master_with_another_acceleration_takes_over_the_present_one(scenario, before, moment):
    """A harder move, or one with another mean, first ends the acceleration; also after a move without a jerk."""
    cell = soft(scenario, WITHOUT_JERK, axis="max_acceleration = 1000.0")
    led = ComputedMotion(cell)
    cell.x.move_absolute(100.0, acceleration=before, jerk=8000.0)
    cell.run(moment)
    assert cell.end_of(cell.x.move_absolute(-20.0, acceleration=400.0, jerk=8000.0)) is None
    assert cell.where("x") == pytest.approx(-20.0, abs=NEAR)
    assert led.worst(2) <= max(before, 400.0) * 1.001
    assert led.worst(3) <= 8000.0 * 1.001
    assert len([row for row in led.rows if row]) == 1
    cell.x.follow(TrapezoidalTrajectory(-20.0, 0.0, 100.0, 500.0))
    cell.run(0.1)
    cell.x.move_absolute(100.0, acceleration=before, jerk=math.inf)
    cell.run(moment)
    led.forget()
    cell.run(0.0301)
    assert cell.end_of(cell.x.move_absolute(-20.0, acceleration=400.0, jerk=8000.0)) is None
    assert moment > 1.0 or led.worst(3) <= 8000.0 * 1.001  # it may have begun to brake meanwhile
    assert cell.where("x") == pytest.approx(-20.0, abs=NEAR)


def test_after_a_trajectory_a_move_of_the_master_continues_with_its_velocity(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    cell.x.follow(TrapezoidalTrajectory(0.0, 200.0, 100.0, 500.0))
    cell.run(1.2)
    assert cell.x.velocity == pytest.approx(100.0, abs=2.0)
    led.forget()
    assert cell.end_of(cell.x.move_absolute(60.0)) is None
    assert cell.where("x") == pytest.approx(60.0, abs=NEAR)
    assert led.worst(2) <= 500.0 * 1.001
    assert led.worst(3) <= JERK * 1.001


def test_a_move_without_jerk_takes_over_from_a_move_of_the_master(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    cell.x.move_absolute(200.0)
    cell.run(0.6)
    assert cell.end_of(cell.x.move_absolute(20.0, jerk=math.inf)) is None
    assert cell.where("x") == pytest.approx(20.0, abs=NEAR)


def test_a_target_that_would_take_a_move_of_the_master_beyond_its_limits_is_refused(scenario):
    cell = soft(scenario, WITHOUT_JERK, axis="position_limits = [-10.0, 205.0]")
    first = cell.x.move_absolute(200.0, velocity=300.0)
    cell.run(0.62)
    error = cell.failure_of(cell.x.move_absolute(100.0, acceleration=150.0))
    assert isinstance(error, LimitError)
    assert "could not stop within the position limits" in str(error)
    assert cell.end_of(first) is None
    assert cell.where("x") == pytest.approx(200.0, abs=NEAR)


def test_a_halt_of_a_move_that_took_over_brakes_as_hard_as_without_jerk(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    cell.x.move_absolute(200.0)
    cell.run(0.5)
    cell.x.move_absolute(300.0)
    cell.run(0.3)
    begun, speed = cell.now, cell.x.velocity
    assert cell.end_of(cell.x.halt()) is None
    assert cell.now - begun < speed / 500.0 + 0.3
    assert cell.end_of(cell.x.move_absolute(0.0)) is None


@pytest.mark.parametrize("seed", range(12))
def test_random_targets_during_the_motion_keep_jerk_and_acceleration(scenario, seed):
    cell, chance = soft(scenario, WITHOUT_JERK), random.Random(seed)
    led, target, handles = ComputedMotion(cell), 0.0, []
    for _ in range(25):
        target = chance.choice([chance.uniform(-150.0, 150.0), target + 0.5])
        handles.append(cell.x.move_absolute(target, velocity=chance.choice([30.0, 150.0, 300.0])))
        cell.run(chance.choice([0.0, 0.01, 0.05, 0.3, 1.0]))
        if chance.random() < 0.3:
            cell.x.set_override(chance.choice([0.0, 0.3, 1.0, 1.5])).wait()
    cell.x.set_override(1.0).wait()
    assert cell.end_of(handles[-1]) is None
    assert all(not handle.busy for handle in handles)
    assert cell.where("x") == pytest.approx(target, abs=NEAR)
    assert led.worst(3) <= JERK * 1.001
    assert led.worst(2) <= 500.0 * 1.001


def test_a_virtual_axis_has_a_jerk_limit_too(scenario):
    cell = scenario.simulated(text=cell_text("", more=virtual("max_velocity = 400.0")))
    v = cell["v"]
    v.enable().wait(5)
    led = ComputedMotion(cell, "v")
    assert cell.end_of(v.move_absolute(100.0, jerk=JERK)) is None
    assert led.worst(3) <= JERK * 1.001
    assert v.position == 100.0


def test_move_direct_moves_each_axis_by_its_own_profile(scenario):
    text = cell_text("x", eds=GENERIC) + cell_text("y", eds=without_jerk(scenario)).partition("\n[nodes.1]")[
        2
    ].join(["\n[nodes.2]", ""])
    text = text.replace("node = 1\nunit", "node = 2\nunit").replace(
        "[axes.x]\nnode = 2", "[axes.x]\nnode = 1"
    )
    text = text.replace("acceleration = 500.0\n", f"acceleration = 500.0\njerk = {JERK}\n")
    cell = scenario.simulated(text=text).enabled()
    assert cell.end_of(cell.machine.group("x", "y").move_direct((50.0, -50.0))) is None
    assert [cell.where(name) for name in "xy"] == pytest.approx([50.0, -50.0], abs=NEAR)


# -- refusals and notes ----------------------------------------------------------------------------------------------------


def test_a_move_of_the_master_does_not_take_over_from_the_drive_and_the_error_gives_the_reason(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    first = cell.x.move_absolute(300.0, jerk=math.inf)
    cell.run(0.5)
    error = cell.failure_of(cell.x.move_absolute(0.0))
    assert isinstance(error, StateError)
    assert "no profile jerk (60A4h with 6086h)" in str(error)
    assert first.active
    assert cell.end_of(first) is None


def test_a_jerk_that_would_take_seconds_is_refused_and_nothing_moves(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    error = cell.failure_of(cell.x.move_absolute(10.0, jerk=10.0))
    assert isinstance(error, LimitError)
    assert "jerk 10 is too small" in str(error)
    assert cell.x.state is AxisState.STANDSTILL
    assert cell.where("x") == pytest.approx(0.0, abs=0.01)


def test_a_drive_without_csp_and_without_a_profile_jerk_cannot(scenario):
    cell = soft(scenario, WITHOUT_JERK, axis='modes = ["pp", "pv", "hm"]')
    error = cell.failure_of(cell.x.move_absolute(10.0))
    assert isinstance(error, StateError)
    assert "its jerk cannot be limited" in str(error)
    assert "it does not have that mode" in str(error)
    assert cell.end_of(cell.x.move_absolute(10.0, jerk=math.inf)) is None


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, "soft", 1e30])
def test_an_invalid_jerk_is_refused_at_the_call(scenario, value):
    cell = scenario.simulated("x")
    with pytest.raises(ArgumentError, match=r"jerk|60A4h"):
        cell.x.move_absolute(10.0, jerk=value)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("eds", [GENERIC, WITHOUT_JERK])
def test_random_moves_under_random_overrides_keep_their_jerk(scenario, eds, seed):
    cell, chance = soft(scenario, eds), random.Random(seed)
    seen = Demand(cell) if eds == GENERIC else ComputedMotion(cell)
    for _ in range(4):
        target = chance.uniform(-150.0, 150.0)
        handle = cell.x.move_absolute(target, velocity=chance.choice([30.0, 150.0, 300.0]))
        while handle.busy:
            cell.run(chance.choice([0.02, 0.1, 0.4]))
            cell.x.set_override(chance.choice([0.3, 0.7, 1.0, 1.5])).wait()
        assert handle.done
        assert cell.where("x") == pytest.approx(target, abs=NEAR)
    assert seen.worst(3) <= JERK * 1.001
    assert seen.worst(2) <= 500.0 * 1.001
