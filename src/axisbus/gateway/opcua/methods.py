"""The methods of a machine: give the commands to every axis, even if one refuses, and return how they ended."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from enum import Enum
from typing import NamedTuple

from axisbus.client_support.merged_stops import MergedStops
from axisbus.errors import AxisbusError, DriveError, OwnershipError, StaleError, UserError
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle, mark_end_as_read
from axisbus.machine.machine import Machine


class OpcuaMethod(Enum):
    """A method, by its name."""

    HALT = "Halt"
    STOP = "Stop"
    RESET = "Reset"

    @property
    def words(self) -> str:
        """The description of the method."""
        return _WORDS[self]


_WORDS = {
    OpcuaMethod.HALT: "Brake to standstill; stays enabled.",
    OpcuaMethod.STOP: "Quick stop, as configured in the drive.",
    OpcuaMethod.RESET: "Reset faults; enables nothing.",
}


class MethodResult(NamedTuple):
    """The result of a method: the name of its OPC UA status code, and a text."""

    status: str
    text: str


NO_MACHINE = MethodResult(
    "BadNoCommunication", "no machine is running, and this call sent nothing to any drive"
)
_REFUSED = (  # the first match counts
    (OwnershipError, "BadUserAccessDenied"),
    (UserError, "BadInvalidState"),
    (TimeoutError, "BadTimeout"),
    (DriveError, "BadDeviceFailure"),
)


def status_of(error: BaseException) -> str:
    """Return the status code for an error, by its name."""
    return next((status for kind, status in _REFUSED if isinstance(error, kind)), "BadInvalidState")


def given(axis: Axis, verb: OpcuaMethod, stops: MergedStops) -> Handle | AxisbusError:
    """Give an axis its command, or return why it is refused; does not block."""
    try:
        if verb is OpcuaMethod.RESET:
            return axis.reset()
        return stops.send(axis.name, "halt" if verb is OpcuaMethod.HALT else "quick_stop")
    except AxisbusError as error:
        return error


async def execute(
    machine: Machine, verb: OpcuaMethod, axes: Sequence[str], stops: MergedStops, limit: float
) -> MethodResult:
    """Give each axis its command at once, and wait at most ``limit`` seconds for all to end.

    An axis that is still braking after that time continues to brake. ``stops`` are those of the machine.
    """
    missing = [name for name in axes if name not in machine.axes]
    known = [machine[name] for name in axes if name in machine.axes]
    commands = [(axis, given(axis, verb, stops)) for axis in known]
    handles = [command for _, command in commands if isinstance(command, Handle)]
    for handle in handles:
        mark_end_as_read(handle)  # the client may be gone before it ends
    if handles:
        await asyncio.wait([asyncio.ensure_future(_end(handle)) for handle in handles], timeout=limit)
    ends = [MethodResult("BadNoCommunication", f"{name}: its node has not come up") for name in missing]
    return _together([*(_of(axis, command, limit) for axis, command in commands), *ends])


async def _end(handle: Handle) -> None:
    with suppress(AxisbusError):  # the handle has the error
        await handle


def _of(axis: Axis, command: Handle | AxisbusError, limit: float) -> MethodResult:
    error = command if isinstance(command, AxisbusError) else command.exception()
    if error is not None:
        return MethodResult(status_of(error), str(error))
    if isinstance(command, Handle) and command.busy:
        after = f"after {limit:g} s" if limit else "yet, and too many calls of this user wait for their ends"
        return MethodResult("BadTimeout", f"{command.name}: not completed {after}; it continues")
    return MethodResult("Good", _position_text(axis))


def _position_text(axis: Axis) -> str:
    try:
        return f"{axis.name}: {axis.state.value} at {axis.position:g} {axis.unit}"
    except StaleError:
        return f"{axis.name}: {axis.snapshot.state.value}; its position is not known"


def _together(ends: Sequence[MethodResult]) -> MethodResult:
    """Return the first status that is not good, else good, and all texts, those of errors first."""
    bad = [end for end in ends if end.status != "Good"]
    text = "\n".join(end.text for end in [*bad, *(end for end in ends if end.status == "Good")])
    return MethodResult(bad[0].status if bad else "Good", text)
