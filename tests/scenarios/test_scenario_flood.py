"""A flood of commands: stops are taken at once, cycles go on, and nothing that a stop has overtaken begins afterwards."""

from __future__ import annotations

import threading
import time

import pytest

from axisbus.core.command_queue import QUEUE_LIMIT
from axisbus.errors import StateError, Stopped
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.commands import MoveVelocity
from axisbus.motion.moves.profile import MoveProfile
from kit.plant_probe import ENABLED, OFF

STOPS = {
    "halt": lambda x: x.halt(),
    "stop": lambda x: x.stop(),
    "quick stop": lambda x: x.quick_stop(),
    "disable": lambda x: x.disable(),
}


@pytest.mark.parametrize("how", STOPS)
@pytest.mark.parametrize("whose", ["axis", "group"])
def test_a_stop_behind_a_thousand_moves_stops_in_the_next_cycle_and_none_of_them_begins(scenario, how, whose):
    cell = scenario.simulated("xy")
    cell.turning(90.0)
    moves = [cell.x.move_velocity(90.0 + number % 100) for number in range(1000)]
    stop = STOPS[how](cell.x if whose == "axis" else cell.machine.group("x", "y"))
    cell.run(0.02)
    assert not any(move.busy for move in moves)
    cell.must_be_still("x", within=0.6, stages=(ENABLED, *OFF), for_good=3.0)
    assert stop.wait(1).done
    assert sum(isinstance(move.exception(), Stopped) for move in moves) > 900
    if whose == "axis":
        cell.must_move("y")


def test_the_request_to_stop_everything_is_taken_before_all_that_waits(scenario):
    cell = scenario.simulated("xy")
    cell.turning(90.0)
    moves = [cell.x.move_velocity(90.0 + number % 100) for number in range(1000)]
    cell.machine.close()
    assert not any(move.busy for move in moves)
    assert all(move.exception() is not None for move in moves)
    for name in "xy":
        cell.must_be_still(name, within=0.1, stages=OFF)


def test_a_command_too_many_is_refused_with_the_remedy(scenario, golden):
    cell = scenario.simulated("x").enabled()
    handles = [cell.x.move_relative(0.01) for _ in range(QUEUE_LIMIT + 1)]
    error = handles[-1].exception()
    assert isinstance(error, StateError)
    golden("too_many_commands", error)
    cell.x.halt().wait(2)
    golden("overtaken_by_a_stop", handles[-2].exception())


PROFILE = MoveProfile(5000, 50_000, 50_000, 5000.0, 50_000.0)  # 50 deg/s
ENDLESS = {
    "a jog that is renewed": MoveVelocity(PROFILE, life=0.2),
    "a motion again and again": MoveVelocity(PROFILE),
}


@pytest.mark.parametrize("what", ENDLESS)
def test_four_threads_that_command_without_a_pause_take_no_cycles_and_keep_no_stop_waiting(scenario, what):
    """Their commands are made in advance, so that they come faster than any scan could take them."""
    cell = scenario.real("xy")
    cell.turning(90.0, names="y")
    scan, over = cell.machine._core.scan, threading.Event()

    def command() -> None:
        while not over.is_set():
            scan.submit("x", ENDLESS[what], CommandStatus("x.flood"))

    threads = [threading.Thread(target=command, daemon=True) for _ in range(4)]
    cycles, begin = scan.lateness.cycles, time.monotonic()
    for thread in threads:
        thread.start()
    try:
        time.sleep(1.5)
        if ENDLESS[what].life is not None:  # a motion that is replaced in each cycle has never begun
            cell.must_move("x")
        halt = cell["y"].halt()
        cell.must_be_still("y", within=1.5, stages=ENABLED, for_good=0.3)
        share = (scan.lateness.cycles - cycles) * scan.period / (time.monotonic() - begin)
        assert halt.done
        assert share > 0.5
    finally:  # else they take the computer from all tests after this one
        over.set()
        for thread in threads:
            thread.join()
    cell.x.halt()
    cell.must_be_still("x", within=2.0, stages=ENABLED)
    assert not scan.ended


def test_users_that_jog_without_a_pause_renew_one_jog(scenario):
    cell = scenario.simulated("x").enabled()
    handles = {cell.x.jog(50.0) for _ in range(5000)}
    assert len(handles) == 1
    cell.run(0.3)
    cell.must_be_still("x", within=1.0, stages=ENABLED)
