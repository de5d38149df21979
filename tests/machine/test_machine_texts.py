"""The texts of a machine and its parts: repr, values other than the cyclic ones, and why a command is rejected."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

import axisbus
from axisbus import AxisState, Machine, Recorder, wait
from axisbus.errors import ArgumentError, StaleError, StateError
from axisbus.machine.signal_shutdown import EXIT

CELL = Path(__file__).parents[2] / "examples" / "cell.toml"
ONE_AXIS = """
[bus]
interface = "sim"
scan_period = "10ms"
[nodes.1]
eds = "builtin:{eds}"
[axes.x]
node = 1
unit = "deg"
scale = 100.0
rated_torque = 10.0
max_velocity = 360.0
max_acceleration = 3600.0
{more}
[axes.x.homing]
required = false
[axes.x.defaults]
velocity = 90.0
acceleration = 720.0
[groups.alone]
axes = ["x"]
"""


@pytest.fixture
def make(tmp_path):
    """Makes a cell of one axis in virtual time."""
    machines = []

    def made(eds: str = "generic-cia402", more: str = "") -> Machine:
        file = tmp_path / "cell.toml"
        file.write_text(ONE_AXIS.format(eds=eds, more=more))
        machines.append(Machine.simulated(file))
        return machines[-1]

    yield made
    for machine in machines:
        machine.close()


def test_the_repr_of_a_machine_and_its_parts():
    with Machine.simulated(CELL) as cell:
        assert repr(cell) == "<Machine cell.toml: x Disabled, y Disabled, z Disabled>"
        assert repr(cell["x"]) == "<Axis x: Disabled at 0 deg>"
        assert repr(cell.group("xyz")) == "<Group xyz: x Disabled, y Disabled, z Disabled>"
        assert "GIM6010-8" in repr(cell.node(2))
        assert repr(cell.node(2)).endswith(", operational>")
        handle = cell["x"].enable()
        assert repr(handle) == "<Handle x.enable(): busy>"
        handle.wait(5)
        cell["x"].move_relative(12.5).wait(5)
        assert repr(cell["x"]).startswith("<Axis x: Standstill at 12.")
    assert repr(cell).startswith("<Machine cell.toml: x Disabled")


def test_axes_and_groups_are_listed_by_name(make):
    cell = make()
    assert list(cell.axes) == ["x"]
    assert cell.axes["x"] is cell["x"]
    assert list(cell.groups) == ["alone"]
    assert cell.groups["alone"] is cell.group("alone")


def test_an_axis_reports_its_limits_its_power_and_its_target(make):
    cell = make(more="position_limits = [-90.0, 270.0]")
    x = cell["x"]
    assert x.limits.position == (-90.0, 270.0)
    assert (x.limits.velocity, x.limits.acceleration) == (360.0, 3600.0)
    assert not x.enabled
    assert x.target is None
    x.enable().wait(5)
    assert x.enabled
    move = x.move_absolute(200.0)
    cell.sleep(1.0)
    assert move.busy
    assert x.target == pytest.approx(200.0)
    assert 0.0 < x.following_error < 20.0
    move.wait(10)
    assert x.following_error == pytest.approx(0.0, abs=0.1)
    x.move_velocity(10.0)
    cell.sleep(0.5)
    assert x.target is None


def test_after_homing_the_following_error_is_known_with_the_next_cycle(make):
    cell = make()
    x = cell["x"]
    x.enable().wait(5)
    x.home(method=35).wait(5)
    with pytest.raises(StaleError, match="a cycle later") as caught:
        _ = x.following_error
    assert "homing ended just now" in caught.value.observed
    cell.sleep(0.05)
    assert x.following_error == pytest.approx(0.0, abs=0.1)


def test_limits_are_shown_without_their_source(make):
    assert "torque_key" not in repr(make()["x"].limits)


def test_an_unknown_value_is_not_reported(make):
    cell = make()
    cell.simulated_node(1).device.dials.dead = True
    cell.sleep(1.0)
    with pytest.raises(StaleError, match="statusword"):
        _ = cell["x"].enabled
    with pytest.raises(StaleError, match="6062h"):
        _ = cell["x"].following_error
    assert "its position is unknown" in repr(cell["x"])


def test_further_values_of_a_drive_are_read_by_its_plug_in(make):
    cell = make("gim6010-8")
    held = cell.simulated_node(1).device.dictionary
    for index, subindex, value in (
        (0x200B, 2, 415),
        (0x6079, 0, 48_200),
        (0x6078, 0, 250),
        (0x6075, 0, 12_000),
    ):
        key = index << 8 | subindex
        held.live.pop(key, None)
        held.set(key, value)
    assert cell["x"].temperature == pytest.approx(41.5)
    assert cell["x"].voltage == pytest.approx(48.2)
    assert cell["x"].current == pytest.approx(3.0)


def test_a_value_without_a_known_object_is_refused(make):
    with pytest.raises(StateError, match="its temperature is not known"):
        _ = make()["x"].temperature


def test_a_torque_without_any_slope_is_refused_at_the_call(make):
    """6087h is 0 from the factory on this make: some such drives never build up a torque."""
    x = make("gim6010-8")["x"]
    x.enable().wait(5)
    with pytest.raises(ArgumentError, match="slope is missing") as caught:
        x.torque_control(1.0)
    assert "6087h" in caught.value.observed
    assert x.state is AxisState.STANDSTILL
    x.torque_control(1.0, slope=100.0).wait(5)


def test_a_slope_of_the_cell_file_or_of_the_drive_is_enough(make):
    x = make()["x"]
    x.enable().wait(5)
    x.torque_control(0.5).wait(5)


def test_a_machine_stopped_by_a_signal_refuses_commands_with_that_reason(make):
    cell = make()
    cell["x"].enable().wait(5)
    cell["x"].move_velocity(50.0)
    cell.sleep(1.0)
    assert cell["x"].error is None
    EXIT._request_stop(2, 1)
    cell.sleep(2.0)
    assert cell["x"].state is AxisState.DISABLED
    assert "Ctrl-C" in str(cell["x"].error)
    assert [str(event) for event in cell.events] == [
        "every axis is being stopped, and further commands are rejected: Ctrl-C"
    ]
    cell.close()
    assert cell["x"].error is None


def test_a_machine_is_left_by_async_with():
    async def moved() -> AxisState:
        async with Machine.simulated(CELL) as cell:
            await cell["x"].enable()
            await asyncio.gather(cell["x"].move_relative(5.0), cell["y"].enable())
            return cell["x"].state

    cell_state = asyncio.run(moved())
    assert cell_state is AxisState.STANDSTILL


def test_leaving_async_with_does_not_block_the_event_loop(tmp_path):
    """In real time: the axis is braked while other tasks run."""
    file = tmp_path / "cell.toml"
    file.write_text(ONE_AXIS.format(eds="generic-cia402", more=""))

    async def leave() -> tuple[Machine, int]:
        ticks = 0

        async def tick() -> None:
            nonlocal ticks
            while True:
                ticks += 1
                await asyncio.sleep(0.005)

        ticking = asyncio.create_task(tick())
        async with Machine.open(file) as cell:
            await cell["x"].enable()
            await cell["x"].move_velocity(90.0)
            before = ticks
        ticking.cancel()
        return cell, ticks - before

    cell, ticks = asyncio.run(leave())
    assert cell["x"].state is AxisState.DISABLED
    assert ticks >= 5


def test_a_recording_is_made_of_a_machine_and_drawn(make, tmp_path):
    pytest.importorskip("matplotlib")
    cell = make()
    with Recorder(cell) as recorder:
        cell["x"].enable().wait(5)
        wait(cell["x"].move_absolute(10.0))
    picture = axisbus.plot(recorder, tmp_path / "new" / "motion.png", "x goes to 10 deg")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.stat().st_size > 10_000
