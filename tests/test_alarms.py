"""A warning that an axis may move is in an error in whatever form the error is shown."""

from __future__ import annotations

import contextlib
import io
import sys
import traceback
from functools import partial
from unittest.mock import patch

import click
import pytest

from axisbus.cli.shared.common import run
from axisbus.core.inprocess import CommandLog
from axisbus.errors import AxisbusError, DriveError, NodeError, one_line
from axisbus.gateway.machine_events import _fault as happening_of_bridge
from axisbus.gateway.ros.node import RosLogThread
from axisbus.gateway.zenoh.publishing import _error_text as told_by_zenoh
from axisbus.ipc.errors import from_fields, to_fields
from axisbus.machine.handle import NOBODY, Handle, wait
from axisbus.machine.machine import _add_notes
from axisbus.motion.command_status import Status
from axisbus.session import CommandEvent
from axisbus.web.commands.clients import _of_error as told_by_page
from axisbus.web.view import _of_error as happening_of_page
from axisbus.web.view import explained

ALARM = "TREAT THE AXIS AS MOVING: use the emergency stop"


def alarming(by: str) -> DriveError:
    """An error whose warning is in its remedy, or came as a note when its machine was left."""
    moving = DriveError(
        "x: not stopped", axis="x", observed="it turns", remedy=f"{ALARM}; then check the cable"
    )
    if by == "remedy":
        return moving
    error = NodeError("x: lost", node=1, observed="no heartbeat", remedy="check the cable")
    error.add_note(f"while stopping: {moving}")
    return error


def ros_log_text(error: AxisbusError) -> str:
    lines: list[str] = []
    saying = RosLogThread(lines.append)
    saying.report("no", error)
    saying.close()
    return "".join(lines)


def printed_by_command(error: BaseException) -> str:
    @click.command()
    def fail() -> None:
        raise error

    printed = io.StringIO()
    with contextlib.redirect_stderr(printed), patch.object(sys, "argv", ["axisbus"]):
        run(fail)
    return printed.getvalue()


def noted(cls: type[BaseException], error: AxisbusError) -> BaseException:
    """The exception that leaves a block of a machine that could not be stopped."""
    found = cls()
    _add_notes(found, [error])
    return found


def raised_by_wait(error: AxisbusError) -> str:
    handles = [Handle(name, NOBODY) for name in "xy"]
    for handle in handles:
        handle._finish(Status.ERROR, error)
    with pytest.raises(ExceptionGroup) as caught:
        wait(handles)
    return str(caught.value)


def kept_by_ledger(error: AxisbusError) -> str:
    ledger = CommandLog(lambda: 0.0)
    ledger.add(1, "x.halt()")
    ledger.note(CommandEvent(1, Status.ERROR, error, ""))
    return ledger.seen[0].error


DOORS = {
    "text": str,
    "traceback": lambda error: "".join(traceback.format_exception(error)),
    "a part of another error": one_line,
    "another process": lambda error: str(from_fields(to_fields(error))),
    "command line": printed_by_command,
    "command line, of a group": lambda error: printed_by_command(ExceptionGroup("two", [error, error])),
    "command line, after Ctrl-C": lambda error: printed_by_command(noted(KeyboardInterrupt, error)),
    "command line, on a full disk": lambda error: printed_by_command(noted(OSError, error)),
    "command line, misused": lambda error: printed_by_command(noted(partial(click.UsageError, "no"), error)),
    "wait": raised_by_wait,
    "page, an axis": lambda error: str(explained(error)),
    "page, what happened": lambda error: str(happening_of_page("x", error)),
    "page, a command": lambda error: str(told_by_page("failed", error)),
    "events of the bridges": lambda error: str(happening_of_bridge("x", error, 0.0)),
    "recording": kept_by_ledger,
    "ROS 2": ros_log_text,
    "Zenoh, an axis": told_by_zenoh,
}


@pytest.mark.parametrize("by", ["remedy", "note"])
@pytest.mark.parametrize("door", DOORS)
def test_a_warning_that_an_axis_moves_is_shown_next_to_every_error(door, by):
    assert ALARM in DOORS[door](alarming(by))


def test_a_traceback_contains_each_part_of_an_error_once():
    told = "".join(traceback.format_exception(alarming("note")))
    for part in ("x: lost", "no heartbeat", "x: not stopped", "it turns", ALARM, "axisbus explain"):
        assert told.count(part) == 1, part


def test_a_signal_that_ends_a_program_without_a_text_leaves_the_warning_in_the_log(caplog):
    noted(SystemExit, alarming("remedy"))
    assert ALARM in caplog.text
