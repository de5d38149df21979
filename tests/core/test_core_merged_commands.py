"""Commands that a core merges: each of them gets the result, also if it was known before."""

from axisbus.core.process import client_handler
from axisbus.core.process.client_handler import DuplicateCommands
from axisbus.motion.command_status import Status
from axisbus.session import CommandEvent


def event(number, status=Status.DONE):
    return CommandEvent(number, status, None, "")


def test_a_command_without_duplicates_is_reported_alone():
    assert DuplicateCommands().all_of(event(1)) == [event(1)]


def test_duplicates_of_a_command_are_reported_with_it_until_it_has_ended():
    made = DuplicateCommands()
    assert made.join(2, 1) is None
    assert made.join(3, 1) is None
    running = event(1, Status.ACTIVE)
    assert made.all_of(running) == [running, event(2, Status.ACTIVE), event(3, Status.ACTIVE)]
    assert made.all_of(event(1)) == [event(1), event(2), event(3)]
    assert made.all_of(event(1)) == [event(1)]


def test_a_duplicate_of_an_ended_command_ends_as_that_did():
    made = DuplicateCommands()
    made.all_of(event(1, Status.ABORTED))
    assert made.join(7, 1) == event(7, Status.ABORTED)


def test_only_the_last_ends_are_kept():
    made = DuplicateCommands()
    for number in range(client_handler._MAX_ENDED + 1):
        made.all_of(event(number))
    assert made.join(1000, 0) is None
    assert made.join(1001, 1) == event(1001)
