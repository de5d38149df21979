"""Drives whose 6062h has no meaning, or is updated rarely: they move, turn, home and halt, and a jam is still detected."""

from __future__ import annotations

import math

import pytest

from axisbus.cia402.port import ValueTransport
from axisbus.errors import FollowingError
from axisbus.motion.parameters import DemandUse, Handshake, HomingParameters
from axisbus.motion.states import AxisState
from kit.motion.rig import Rig, rig

# How 6062h travels.
WAYS = {
    "with each SYNC": {},
    "polled by SDO": {"inputs": {"demand": ValueTransport.SDO}, "sdo_poll": 0.25},
    "on change": {"inputs": {"demand": ValueTransport.EVENT_PDO}},
    "by event timer": {"inputs": {"demand": ValueTransport.EVENT_PDO}, "event_timer": 0.2},
    "position on change, demand polled": {
        "inputs": {"demand": ValueTransport.SDO, "position": ValueTransport.EVENT_PDO},
        "event_timer": 0.02,
        "sdo_poll": 0.25,
    },
}
HABITS = {
    "right": "",
    "stays where it was": "demand_frozen",
    "is 6064h": "demand_is_actual",
    "is the target at once": "demand_is_target",
}


def drive_with(habit: str, way: str, **changes) -> Rig:
    r = rig(port=WAYS[way], homing=HomingParameters(method=35), **changes)
    r.device.write(0x6065, 0, 0xFFFF_FFFF)  # the drive itself does not watch
    if HABITS[habit]:
        setattr(r.drive.dials, HABITS[habit], True)
    return r


@pytest.mark.parametrize("acceleration", [500.0, 5000.0])
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("habit", HABITS)
def test_a_drive_with_any_behaviour_of_6062h_obeys_its_commands(habit, way, acceleration):
    r = drive_with(habit, way)
    axis = r.axis
    axis.enable().wait(5)
    for target in (80.0, -40.0, 20.0):
        axis.move_absolute(target, velocity=300.0, acceleration=acceleration).wait(10)
        assert axis.position == pytest.approx(target, abs=0.1)
    axis.move_velocity(200.0, acceleration=acceleration).wait(5)
    r.run(0.5)
    axis.halt().wait(5)
    axis.home().wait(5)
    axis.move_absolute(50.0, acceleration=acceleration)
    r.run(0.4)
    axis.halt().wait(5)
    r.run(1.0)
    assert (axis.state, axis.error) == (AxisState.STANDSTILL, None)
    axis.disable().wait(5)
    r.drive.axis.motor.position += 20_000.0  # turned by hand, without power
    r.run(1.0)
    axis.enable().wait(5)
    r.run(1.0)
    assert (axis.state, axis.error) == (AxisState.STANDSTILL, None)


@pytest.mark.parametrize("way", WAYS)
def test_a_jam_of_the_first_move_is_seen_by_a_6062h_that_is_right(way):
    """The demand proves itself by running away from the axis."""
    r = drive_with("right", way)
    r.axis.enable().wait(5)
    r.drive.dials.blocked = True
    start = r.now
    with pytest.raises(FollowingError, match="does not follow"):
        r.axis.move_absolute(300.0).wait(10)
    assert r.now - start < (0.7 if way == "with each SYNC" else 1.6)


@pytest.mark.parametrize("way", WAYS)
def test_a_jam_in_a_later_move_is_seen(way):
    r = drive_with("right", way)
    r.axis.enable().wait(5)
    r.axis.move_absolute(100.0).wait(10)
    handle = r.axis.move_absolute(-300.0)
    r.run(1.0)
    r.drive.dials.blocked = True
    start = r.now
    with pytest.raises(FollowingError, match="does not follow"):
        handle.wait(10)
    assert r.now - start < (0.6 if way == "with each SYNC" else 1.2)


@pytest.mark.parametrize("habit", [habit for habit, dial in HABITS.items() if dial])
def test_a_jam_that_no_6062h_shows_is_seen_by_the_drives_own_watch(habit):
    """6065h and 6066h stay watched: by bit 13 of the statusword."""
    r = drive_with(habit, "with each SYNC", drive_following_error=5000, drive_following_time=0.1)
    r.device.write(0x6065, 0, 5000)
    r.device.write(0x6066, 0, 60_000)
    r.axis.enable().wait(5)
    r.run(0.1)
    handle = r.axis.move_absolute(300.0)
    r.run(0.5)
    r.drive.dials.blocked = True
    start = r.now
    with pytest.raises(FollowingError, match="its drive reports a following error") as caught:
        handle.wait(10)
    assert r.now - start < 0.5
    assert "bit 13" in caught.value.observed


def test_without_the_comparison_the_drives_own_watch_stays_and_so_does_standstill():
    r = drive_with(
        "right", "with each SYNC", compares_demand=False, drive_following_error=5000, drive_following_time=0.1
    )
    r.device.write(0x6065, 0, 5000)
    r.device.write(0x6066, 0, 60_000)
    r.axis.enable().wait(5)
    r.axis.move_absolute(50.0).wait(5)
    assert r.core.image.demand is not None  # at standstill it still counts
    handle = r.axis.move_absolute(300.0)
    r.run(0.5)
    r.drive.dials.blocked = True
    with pytest.raises(FollowingError, match="its drive reports a following error"):
        handle.wait(10)


@pytest.mark.parametrize(
    ("habit", "changes", "told"),
    [
        ("is 6064h", {}, "6062h has not yet been seen to follow the set-points"),
        ("right", {"demand": DemandUse.IGNORE}, '6062h is not used (demand = "ignore")'),
        ("right", {"demand": DemandUse.USE}, ""),
    ],
)
def test_a_stop_that_was_seen_by_the_position_alone_has_a_note(habit, changes, told):
    r = drive_with(habit, "with each SYNC", **changes)
    r.axis.enable().wait(5)
    r.axis.move_absolute(300.0)
    r.run(0.5)
    stopped = r.axis.halt()
    stopped.wait(5)
    assert told in stopped.note
    assert bool(told) is bool(stopped.note)


def test_a_6062h_that_the_cell_file_leaves_out_pulls_nowhere_and_one_that_it_uses_does():
    """The drive pulls a jammed axis at standstill; its 6062h was not received before."""
    for use, is_pulled in ((DemandUse.IGNORE, False), (DemandUse.USE, True)):
        r = drive_with("stays where it was", "with each SYNC", demand=use)
        r.axis.enable().wait(5)
        r.run(0.1)
        r.drive.position_demand += 50_000
        r.run(0.5)
        assert (r.axis.error is not None) is is_pulled


def test_in_csp_the_target_counts_as_demand_if_6062h_does_not():
    r = drive_with("stays where it was", "with each SYNC")
    r.axis.enable().wait(5)
    group = r.group("x")
    group.move_linear((60.0,), velocity=100.0, acceleration=500.0).wait(5)
    move = group.move_linear((0.0,), velocity=100.0, acceleration=500.0)
    r.run(0.3)
    r.drive.dials.blocked = True
    with pytest.raises(FollowingError):
        move.wait(10)


def moves_all_the_same(r: Rig) -> None:
    """Enable, move, turn, home and halt."""
    axis = r.axis
    axis.enable().wait(5)
    for target in (80.0, -40.0):
        axis.move_absolute(target, velocity=300.0, acceleration=2000.0).wait(10)
        assert axis.position == pytest.approx(target, abs=0.1)
    axis.move_velocity(200.0, acceleration=2000.0).wait(5)
    r.run(0.5)
    axis.halt().wait(5)
    axis.home().wait(5)
    axis.move_absolute(90.0)
    r.run(0.4)
    axis.halt().wait(5)
    r.run(1.0)
    assert (axis.state, axis.error) == (AxisState.STANDSTILL, None)


INPUTS = ("statusword", "mode", "position", "velocity", "torque", "demand")
SILENT = ("statusword", "mode", "velocity", "torque", "demand")  # the position is polled as well
OTHERS = {
    "bit 12 late": ({"acknowledge_delay": 0.15}, {}, {}),
    "bit 12 proves nothing": ({"acknowledge_stays": True}, {}, {"handshake": Handshake.ON_CHANGE}),
    "bit 12 never": ({"acknowledge_never": True}, {}, {"handshake": Handshake.ON_CHANGE}),
    "bit 10 late": ({"target_reached_late": 0.3}, {}, {}),
    "6061h late": ({"mode_delay": 0.3}, {}, {}),
    "all on change, without event timer": (
        {},
        {
            "inputs": dict.fromkeys(INPUTS, ValueTransport.EVENT_PDO),
            "max_age": dict.fromkeys(SILENT, math.inf),
        },
        {},
    ),
    "all but statusword, position and controlword by SDO": (
        {},
        {
            "inputs": dict.fromkeys(("mode", "velocity", "torque", "demand"), ValueTransport.SDO),
            "outputs": dict.fromkeys(
                ("target_position", "target_velocity", "target_torque"), ValueTransport.SDO
            ),
            "sdo_time": 0.01,
        },
        {},
    ),
}


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("habit", HABITS)
def test_other_habits_of_such_drives_change_nothing(habit, other):
    dials, port, changes = OTHERS[other]
    r = rig(port=port, homing=HomingParameters(method=35), **changes)
    r.device.write(0x6065, 0, 0xFFFF_FFFF)
    for name, value in (dials | ({HABITS[habit]: True} if HABITS[habit] else {})).items():
        setattr(r.drive.dials, name, value)
    moves_all_the_same(r)
