"""Commands in the queue of the scan: their order, stops that overtake, merging of equal ones, and a bound for a flood."""

from __future__ import annotations

import gc
import logging
import threading

import pytest

from axisbus.core.command_queue import COMMANDS_PER_CYCLE, QUEUE_LIMIT, CommandQueue, QueuedCommand
from axisbus.errors import StateError, Stopped
from axisbus.machine.handle import Handle
from axisbus.motion import commands as c
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.group.commands import ForEach, GroupContinue, GroupSetOverride, MoveLinear, MovePath
from axisbus.motion.group.path import EMPTY_PATH
from axisbus.motion.moves.profile import MoveProfile
from kit.motion.rig import rig

PROFILE = MoveProfile(1000, 10_000, 10_000, 1000.0, 10_000.0)
TURN = c.MoveVelocity(PROFILE)
JOG = c.MoveVelocity(PROFILE, life=0.2)
ENDLESS = 10**6


def move(value: int) -> c.Move:
    return c.Move(c.TargetReference.RELATIVE, value, PROFILE)


def given(inbox: CommandQueue, target, command) -> QueuedCommand | None:
    return inbox.put(QueuedCommand(target, command, CommandStatus(f"{target}.{type(command).__name__}")))


def commands(taken: list[QueuedCommand]) -> list:
    return [(waiting.target, waiting.command) for waiting in taken]


def test_commands_that_fit_into_one_cycle_are_taken_in_order_with_stops_among_them():
    inbox = CommandQueue()
    wanted = [("x", move(1)), ("x", c.Halt()), ("x", move(2)), ("y", c.EnableCommand()), ("x", c.Stop())]
    for target, command in wanted:
        given(inbox, target, command)
    assert commands(inbox.take()) == wanted
    assert inbox.take() == []


def test_commands_too_many_for_one_cycle_wait_for_the_next_in_order():
    inbox = CommandQueue()
    wanted = [("x", move(number)) for number in range(3 * COMMANDS_PER_CYCLE + 5)]
    for target, command in wanted:
        given(inbox, target, command)
    cycles = [commands(inbox.take()) for _ in range(5)]
    assert [len(cycle) for cycle in cycles] == [
        COMMANDS_PER_CYCLE,
        COMMANDS_PER_CYCLE,
        COMMANDS_PER_CYCLE,
        5,
        0,
    ]
    assert [waiting for cycle in cycles for waiting in cycle] == wanted


@pytest.mark.parametrize("stop", [c.Halt(), c.Stop(), c.QuickStop(), c.Disable(), c.Disable(coast=True)])
def test_a_stop_is_taken_at_once_and_ends_the_commands_that_it_overtakes(stop):
    inbox = CommandQueue()
    first = [given(inbox, "x", move(number)) for number in range(COMMANDS_PER_CYCLE)]
    overtaken = [given(inbox, "x", move(ENDLESS + number)) for number in range(100)]
    others = [given(inbox, "y", move(number)) for number in range(100)]
    halt = given(inbox, "x", stop)
    later = given(inbox, "x", move(-1))
    assert inbox.take() == [*first, halt]
    for waiting in overtaken:
        assert isinstance(waiting.ticket.error, Stopped)
        assert "had not begun when" in str(waiting.ticket.error)
    rest = [waiting for _ in range(10) for waiting in inbox.take()]
    assert rest == [*others, later]


def test_a_stop_overtakes_all_commands_that_share_an_axis_with_it():
    inbox = CommandQueue()
    for number in range(COMMANDS_PER_CYCLE):
        given(inbox, "z", move(number))
    line = given(inbox, ("x", "y"), MoveLinear({"x": 1.0, "y": 1.0}, 1.0, 1.0))
    path = given(inbox, "g", MovePath(("x", "y"), EMPTY_PATH, 1.0))
    resumed = given(inbox, "g", GroupContinue(("x", "y")))
    own = given(inbox, "y", move(1))
    halt = given(inbox, "x", c.Halt())  # takes the line with it, and leaves y's own move
    again = given(inbox, "w", move(1))
    all_ = given(inbox, "g", ForEach({"y": c.Stop(), "w": c.Stop()}))
    assert inbox.take()[COMMANDS_PER_CYCLE:] == [halt, all_]
    assert all(isinstance(waiting.ticket.error, Stopped) for waiting in (line, path, resumed, own, again))


def test_a_stop_leaves_an_override_that_waits():
    inbox = CommandQueue()
    for number in range(COMMANDS_PER_CYCLE):
        given(inbox, "z", move(number))
    override = given(inbox, "g", GroupSetOverride(0.5))
    halt = given(inbox, "x", c.Halt())
    assert inbox.take()[COMMANDS_PER_CYCLE:] == [halt]
    assert inbox.take() == [override]


@pytest.mark.parametrize(
    "command",
    [c.EnableCommand(), c.ResetCommand(), c.Halt(), c.Stop(), c.Release(), c.QuickStop(), c.Disable(), JOG],
)
def test_an_equal_command_that_is_still_queued_is_one_command_with_one_handle(command):
    inbox = CommandQueue()
    first = given(inbox, "x", command)
    given(inbox, "y", move(1))  # of another axis
    assert given(inbox, "x", command) is first
    assert inbox.take()[0] is first
    later = given(inbox, "x", command)  # the first has been taken: this one is for the next cycle
    assert later is not first
    given(inbox, "x", move(1))
    assert given(inbox, "x", command) is not later  # something came in between
    assert len(inbox.take()) == 3


@pytest.mark.parametrize("command", [move(5), TURN, c.SetPosition(5), c.Home(None)])
def test_commands_that_differ_in_effect_stay_two_commands(command):
    inbox = CommandQueue()
    assert given(inbox, "x", command) is not given(inbox, "x", command)
    assert len(inbox.take()) == 2


def test_equal_group_commands_are_merged_only_if_no_axis_got_another_command_between():
    inbox = CommandQueue()
    halts = ForEach({"x": c.Halt(), "y": c.Halt()})
    first = given(inbox, "g", halts)
    assert given(inbox, "g", ForEach({"x": c.Halt(), "y": c.Halt()})) is first
    given(inbox, "y", move(1))
    assert given(inbox, "g", halts) is not first


def test_no_more_than_so_many_wait_but_a_stop_finds_room():
    inbox = CommandQueue()
    for number in range(QUEUE_LIMIT):
        assert given(inbox, "x", move(number)) is not None
    assert given(inbox, "y", move(0)) is None
    for _ in range(1000):
        for command in (c.Halt(), c.Stop(), c.QuickStop()):
            assert given(inbox, "x", command) is not None
    assert len(inbox) == QUEUE_LIMIT + 3
    taken = inbox.take()
    assert len(taken) == COMMANDS_PER_CYCLE + 3
    assert len(inbox) == 0  # the stops have overtaken the rest
    assert given(inbox, "y", move(0)) is not None


def test_a_closed_inbox_takes_nothing_and_gives_back_all_that_waits():
    inbox = CommandQueue()
    waiting = [given(inbox, "x", move(number)) for number in range(COMMANDS_PER_CYCLE + 10)]
    taken = inbox.take()
    waiting.append(given(inbox, "x", move(-1)))
    inbox.close()
    assert given(inbox, "x", c.Halt()) is None
    assert taken + list(inbox.clear()) == waiting
    assert len(inbox) == 0


def test_commands_of_several_threads_are_taken_once_each_and_in_the_order_of_each_thread():
    inbox = CommandQueue()
    taken: list[QueuedCommand] = []
    done = threading.Event()

    def give(name: str) -> None:
        number = 0
        while number < 2000:
            if given(inbox, name, move(number)) is not None:
                number += 1

    threads = [threading.Thread(target=give, args=(name,)) for name in "wxyz"]
    scan = threading.Thread(target=lambda: [taken.extend(inbox.take()) for _ in iter(done.is_set, True)])
    for thread in (scan, *threads):
        thread.start()
    for thread in threads:
        thread.join()
    done.set()
    scan.join()
    while len(inbox):
        taken += inbox.take()
    for name in "wxyz":
        assert [waiting.command.value for waiting in taken if waiting.target == name] == list(range(2000))


# With a scan behind it.


def test_a_command_too_many_ends_its_handle_at_once_with_the_reason():
    r = rig("x").enabled()
    handles = [r.axis.move_relative(0.001) for _ in range(QUEUE_LIMIT + 1)]
    error = handles[-1].exception()
    assert isinstance(error, StateError)
    assert "too many commands are waiting" in str(error)
    assert all(handle.busy for handle in handles[:-1])
    halt = r.axis.halt()
    halt.wait(2)
    assert not any(handle.busy for handle in handles)


def alive() -> int:
    """How many handles and tickets there are, also those of other tests."""
    return sum(type(one) in (Handle, CommandStatus) for one in gc.get_objects())


def test_a_flood_of_jogs_is_one_jog_and_keeps_nothing_in_memory():
    r = rig("x").enabled()
    gc.collect()
    before = alive()
    handles = {id(r.axis.jog(20.0)): None for _ in range(100_000)}
    assert len(handles) == 1
    r.run(0.1)
    gc.collect()
    assert alive() - before < 5
    assert abs(r.drive.axis.motor.velocity) > 1000


def test_a_failed_handle_is_logged_although_its_command_was_the_last_for_its_axis(caplog):
    r = rig("x")
    with caplog.at_level(logging.ERROR, "axisbus"):
        r.axis.move_relative(1.0)
        r.run(0.1)
        gc.collect()  # an exception and the frames that it came from hold each other
    assert "x.move_relative(1 deg) failed, and its handle was not read" in caplog.text
