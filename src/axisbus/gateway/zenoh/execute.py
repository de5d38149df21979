"""Execute commands on a machine, and determine how they ended."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from axisbus.errors import AxisbusError, CommandError
from axisbus.fleet.messages import CommandAnswer
from axisbus.gateway.zenoh.command_table import BridgeAction
from axisbus.gateway.zenoh.redact_process import fields_of
from axisbus.machine.handle import Handle, look_at_end
from axisbus.machine.machine import Machine

log = logging.getLogger("axisbus")
RUNNING = CommandAnswer("running")


class CommandExecutor:
    """The state of one command: its handles, one for each axis, and the error if it was refused at the call."""

    def __init__(self, handles: Sequence[Handle], refused: AxisbusError | None = None) -> None:
        self.handles = tuple(handles)
        self._refused = refused
        for handle in self.handles:
            look_at_end(handle)  # the client may be gone

    @property
    def busy(self) -> bool:
        """Whether it still runs."""
        return any(handle.busy for handle in self.handles)

    @property
    def error(self) -> AxisbusError | None:
        """The error that ended it or refused it; the first, if there are several."""
        ends = (handle.exception() for handle in self.handles if not handle.busy)
        return self._refused or next((error for error in ends if error is not None), None)

    @property
    def answer(self) -> CommandAnswer:
        """Its state, as a message."""
        if self.busy:
            return RUNNING
        if (error := self.error) is not None:
            return failed(error)
        return CommandAnswer("done", note="; ".join(handle.note for handle in self.handles if handle.note))


def perform(machine: Machine, act: BridgeAction) -> CommandExecutor:
    """Give a command to each of its axes; if one refuses at the call, the others get it all the same. Does not block."""
    handles, refused = list[Handle](), list[AxisbusError]()
    for name in act.axes:
        try:
            handles.append(getattr(machine[name], act.call)(**act.values))
        except AxisbusError as error:
            refused.append(error)
        except Exception as error:  # the other axes have to be stopped in any case
            log.exception("%s could not be executed", act)
            refused.append(CommandError(f"{act}: it could not be executed", observed=str(error)))
    return CommandExecutor(handles, refused[0] if refused else None)


def failed(error: AxisbusError) -> CommandAnswer:
    """Return the answer that reports an error."""
    return CommandAnswer("error", fields_of(error))
