"""Execute commands on a machine, and determine how they ended."""

from __future__ import annotations

import logging
import os
import re
import threading
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import msgspec

from axisbus.client_support.merged_stops import MergedStops
from axisbus.errors import AxisbusError, CommandError
from axisbus.fleet.messages import CommandAnswer
from axisbus.gateway.zenoh.command_table import BridgeAction
from axisbus.ipc.errors import ErrorFields, to_fields
from axisbus.machine.handle import Handle, mark_end_as_read
from axisbus.machine.machine import Machine

log = logging.getLogger("axisbus")
RUNNING = CommandAnswer("running")


class CommandExecutor:
    """The state of one command: its handles, one for each axis, and the error if it was refused at the call."""

    def __init__(self, handles: Sequence[Handle], refused: AxisbusError | None = None) -> None:
        self.handles = tuple(handles)
        self._refused = refused
        for handle in self.handles:
            mark_end_as_read(handle)  # the client may be gone

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


def perform(machine: Machine, action: BridgeAction) -> CommandExecutor:
    """Give a command to each of its axes; if one refuses at the call, the others get it all the same. Does not block."""
    return _each(action, lambda name: getattr(machine[name], action.call)(**action.values))


def stop(stops: MergedStops, action: BridgeAction) -> CommandExecutor:
    """As ``perform``, for a stop."""
    return _each(action, lambda name: stops.send(name, action.call))


def _each(action: BridgeAction, send: Callable[[str], Handle]) -> CommandExecutor:
    handles, refused = list[Handle](), list[AxisbusError]()
    for name in action.axes:
        try:
            handles.append(send(name))
        except AxisbusError as error:
            refused.append(error)
        except Exception as error:  # the other axes have to be stopped in any case
            log.exception("%s could not be executed", action)
            refused.append(CommandError(f"{action}: it could not be executed", observed=str(error)))
    return CommandExecutor(handles, refused[0] if refused else None)


def failed(error: AxisbusError) -> CommandAnswer:
    """Return the answer that reports an error."""
    return CommandAnswer("error", fields_of(error))


# -- Remove this process from texts of the core before they are sent: for the network, the holder of the lease counts ----


_PROCESS = rf"process {os.getpid()} \(.*?\), which began at \d+:\d+:\d+"
_THIS_PROCESS = re.compile(rf" by {_PROCESS}|{_PROCESS}: ")


def without_process(text: str) -> str:
    """Return a text without this process."""
    return _THIS_PROCESS.sub("", text)


def fields_of(error: AxisbusError) -> ErrorFields:
    """Return an error as plain values, with this process removed from its texts."""
    found = to_fields(error)
    texts = {
        name: without_process(one) if isinstance(one, str) else one for name, one in found.fields.items()
    }
    return msgspec.structs.replace(found, fields=texts)


# -- Answer commands when they end, in one thread, so that no thread of the network waits for a machine ----------------


REPLY_TIMEOUT = 2.0  # seconds after which a command that still runs is answered "running"
_MAX_WAITING = 256  # the most waiting answers; further commands are answered "running" at once
_SLICE = 1.0  # seconds, the longest sleep of the thread
Reply = Callable[[CommandAnswer], None]


class _Waiting(NamedTuple):
    executor: CommandExecutor
    reply: Reply
    deadline: float


class DeferredReplies:
    """Hold the waiting answers; ``put`` is for any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: list[_Waiting] = []
        self._changed = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="answers", daemon=True)
        self._thread.start()

    def put(self, executor: CommandExecutor, reply: Reply) -> None:
        """Call ``reply`` when a command has ended, or after ``REPLY_TIMEOUT`` seconds; does not block."""
        with self._lock:
            full = len(self._waiting) >= _MAX_WAITING
            deadline = 0.0 if full else time.monotonic() + REPLY_TIMEOUT
            self._waiting.append(_Waiting(executor, reply, deadline))
        for handle in executor.handles:
            if handle.busy:
                handle.add_done_callback(self._changed.set)
        self._changed.set()

    def close(self) -> None:
        """Answer the waiting commands, and end; blocks briefly."""
        self._closing = True
        self._changed.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closing:
            self._changed.wait(self._next())
            self._changed.clear()
            self._reply_ready()
        self._reply_ready()

    def _next(self) -> float:
        with self._lock:
            due = min((each.deadline for each in self._waiting), default=None)
        return _SLICE if due is None else min(_SLICE, max(0.0, due - time.monotonic()))

    def _reply_ready(self) -> None:
        now = time.monotonic()
        with self._lock:
            ready = [
                each
                for each in self._waiting
                if self._closing or not each.executor.busy or each.deadline <= now
            ]
            self._waiting = [each for each in self._waiting if each not in ready]
        for each in ready:
            try:
                each.reply(each.executor.answer if not each.executor.busy else RUNNING)
            except Exception as error:  # noqa: BLE001  # the client is gone
                log.debug("an answer could not be sent: %s", error)
