"""Commands of a fleet: stops from any client, all others from the holder of the lease; none is executed twice."""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Collection, Hashable
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

from axisbus.client_support.dead_man import SILENCE, DeadMan, MessageLag
from axisbus.client_support.merged_stops import MergedStops
from axisbus.errors import ArgumentError, AxisbusError, Replaced, StateError
from axisbus.fleet.messages import TOO_LATE, CommandAnswer, CommandAsk
from axisbus.gateway.zenoh.command_table import JOG, STOPS, BridgeAction, action_of
from axisbus.gateway.zenoh.execute import (
    RUNNING,
    CommandExecutor,
    DeferredReplies,
    Reply,
    failed,
    perform,
    stop,
)
from axisbus.gateway.zenoh.lease_manager import Holding
from axisbus.ipc.rate import Bucket
from axisbus.machine.handle import Handle, mark_end_as_read
from axisbus.machine.machine import Machine

LONGEST = 64  # characters of a client's name
_STOPS = 256  # the most running stops that are remembered


class Commands:
    """Hold the ids and jogs of all clients, and the running stops; for any thread. Nothing here blocks."""

    def __init__(
        self,
        machine: Machine,
        holding: Holding,
        answers: DeferredReplies,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """``machine`` is joined without control: it executes stops, whichever client has control."""
        self._machine = machine
        self._holding = holding
        self._answers = answers
        self._clock = clock
        self._lock = threading.Lock()
        self._commands: CommandDeduplicator[CommandExecutor] = CommandDeduplicator()
        self._jogs = Jogs()
        self._rate: tuple[str, Bucket] = "", Bucket()  # of the holder of the lease
        self._stops: OrderedDict[Hashable, CommandExecutor] = OrderedDict()
        self._merged = MergedStops(machine)

    def execute(self, verb: str, request: CommandAsk, reply: Reply) -> None:
        """Execute a command; ``reply`` is called at its end, in any thread, or after 2 s with ``running``."""
        try:
            if verb in STOPS:
                self._answers.put(self._stop(verb, request), reply)
                return
            with self._lock:
                found = self._execute(verb, request)
        except AxisbusError as error:
            reply(failed(error))
            return
        if isinstance(found, CommandAnswer):
            reply(found)
        else:
            self._answers.put(found, reply)

    def _stop(self, verb: str, request: CommandAsk) -> CommandExecutor:
        """Stop; a repeated stop counts as the same one only while it runs: the answer never comes from the cache."""
        action = action_of(verb, request, tuple(self._machine.axes))
        key = verb, request.client, request.id, action.axes
        with self._lock:
            self._jogs.note_stop(action.axes)
            if self._holding.lease.holds(request.client, request.token, self._clock()):
                self._commands.note_id(
                    request.client, request.id
                )  # an earlier command that arrives after it is too late
            running = self._stops.get(key)
            if running is not None and running.busy:
                return running
            self._stops[key] = executor = stop(self._merged, action)
            self._stops.move_to_end(key)
            while len(self._stops) > _STOPS:
                self._stops.popitem(last=False)
        return executor

    def _execute(self, verb: str, request: CommandAsk) -> CommandExecutor | CommandAnswer:
        _require_valid(request)
        what = verb, request.axes, tuple(sorted(request.values.items())), request.token
        repeated = None if verb == JOG else self._commands.repeated(request.client, request.id, what)
        if repeated is not None:
            return repeated
        controlled, now = self._with_control(request)
        action = action_of(verb, request, tuple(controlled.axes))
        self._merged.overtake(action.axes)
        if verb == JOG:
            if self._commands.note_id(request.client, request.id):
                self._jogs.jog(controlled, request.client, action, now)
            return RUNNING
        executor = perform(controlled, action)
        self._commands.enter(request.client, request.id, what, executor)
        return executor

    def _with_control(self, request: CommandAsk) -> tuple[Machine, float]:
        """Return the machine with control for the client of a command, and the time.

        Raises:
            OwnershipError: the client has no lease.
            StateError: the client sends too many commands.
        """
        now, lease, controlled = self._clock(), self._holding.lease, self._holding.controlled
        if controlled is None or not lease.holds(request.client, request.token, now):
            raise lease.why_not(request.client, request.token, now)
        if self._rate[0] != lease.token:
            self._rate = lease.token, Bucket()
        if not self._rate[1].take(now):
            raise StateError(
                f"nothing was done: {lease.client_name} sends too many commands in too short a time",
                remedy="send at most 60 commands a second; halt and quick stop are always accepted",
            )
        return controlled, now


def _require_valid(request: CommandAsk) -> None:
    require_id(request.id)
    if not request.client or len(request.client) > LONGEST:
        raise ArgumentError(
            "a client has no name, or its name is too long",
            remedy=f"at most {LONGEST} characters are allowed",
        )


# ----------------------------------------------------------------------------------------------------------------------
# The commands of each client by their ids: a repeated id is the same command, and an id that comes too late is rejected.


MAX_COMMANDS = 256  # commands of a client
CLIENTS = 64
State = TypeVar("State")  # the state of a given command


@dataclass(slots=True)
class _Client(Generic[State]):
    highest: int = 0
    given: OrderedDict[int, tuple[Hashable, State]] = field(default_factory=OrderedDict)


class CommandDeduplicator(Generic[State]):
    """Hold the last commands of the last clients. For one thread at a time.

    Only the holder of the lease enters commands. A client that was forgotten has not had the lease since many others, and its token
    is void.
    """

    def __init__(self, max_commands: int = MAX_COMMANDS, clients: int = CLIENTS) -> None:
        self._max_commands = max_commands
        self._max_clients = clients
        self._clients: OrderedDict[str, _Client[State]] = OrderedDict()

    def repeated(self, client: str, number: int, what: Hashable) -> State | None:
        """Return the command that a client has already given with this id; None if the id is new.

        Raises:
            StateError: the id is lower than the newest and no longer cached, or it belonged to another command.
        """
        known = self._clients.get(client)
        if known is None or (number not in known.given and number > known.highest):
            return None
        if number not in known.given:
            raise StateError(
                f"command {number} of {client} {TOO_LATE}",
                observed=f"command {known.highest} was received before, and this one is no longer stored",
                remedy="count the ids upwards; a restarted program uses another name",
            )
        before, state = known.given[number]
        if (
            before != what
        ):  # also if a program restarts under its old name: it must not get answers of its previous run
            raise StateError(
                f"command {number} of {client} was a different command: nothing was done",
                observed="it had other contents, or belonged to an earlier lease",
                remedy="give each command its own id; a restarted program uses another name",
            )
        return state

    def enter(self, client: str, number: int, what: Hashable, state: State) -> None:
        """Note a command that is given now."""
        known = self._known(client)
        known.highest = max(known.highest, number)
        known.given[number] = what, state
        while len(known.given) > self._max_commands:
            known.given.popitem(last=False)

    def note_id(self, client: str, number: int) -> bool:
        """Note an id without storing its command; return whether it is higher than all earlier ids of the client."""
        known = self._known(client)
        newer = number > known.highest
        known.highest = max(known.highest, number)
        return newer

    def _known(self, client: str) -> _Client[State]:
        known = self._clients.setdefault(client, _Client())
        self._clients.move_to_end(client)
        while len(self._clients) > self._max_clients:
            self._clients.popitem(last=False)
        return known


def require_id(number: int) -> None:
    """Check that a number is valid as the id of a command.

    Raises:
        ArgumentError: the number is below 1, or above 2^53.
    """
    if not 0 < number <= 1 << 53:
        raise ArgumentError(f"{number} is not the id of a command", remedy="count them from 1")


# -- Jogs of a fleet: each lasts 0.2 s from its last query; a press is over after silence, a halt or a late query ------


_CLIENTS = 64
_PRESS_AGAIN = "release the button, and press it again"


@dataclass(slots=True)
class _Presses:
    """The buttons of one client: by axis, whether each is held, and its last jog. ``lag`` is that of all of its messages."""

    lag: MessageLag = field(default_factory=MessageLag)
    held: dict[str, tuple[DeadMan, Handle | None]] = field(default_factory=dict)


class Jogs:
    """Hold the pressed buttons of each client, one for each axis, and their last jogs; for one thread at a time."""

    def __init__(self) -> None:
        self._clients: OrderedDict[str, _Presses] = OrderedDict()

    def jog(self, machine: Machine, client: str, action: BridgeAction, now: float) -> None:
        """Start or continue a jog by one query of a client; ``now`` in s, monotonic. Does not block.

        Raises:
            StateError: the press is over, or the query comes too late.
            AxisbusError: the error that ended the jog of this press; or as ``Axis.jog``.
        """
        values, axis, presses = action.values, action.axes[0], self._of(client)
        before, last = presses.held.get(axis, (DeadMan(), None))
        lag = presses.lag = presses.lag.updated(values["sent"], now)
        direction = math.copysign(1.0, values["velocity"])
        broken = self._broken(last)
        continues = before.is_held_by(values["press"])
        deadman = before.ended() if continues and broken is not None else before
        deadman = replace(deadman, lag=lag)
        after = deadman.beaten(values["press"], axis, direction, values["sent"], now)
        broken_off = continues and broken is not None
        if broken_off or not after.held:
            presses.held[axis] = after.ended(), None
            if before.held and not broken_off:
                machine[axis].halt()
            raise broken if broken_off and broken is not None else _late_error()
        handle = machine[axis].jog(
            values["velocity"], acceleration=values.get("acceleration"), continue_only=continues
        )
        mark_end_as_read(handle)
        presses.held[axis] = after, handle

    def note_stop(self, axes: Collection[str]) -> None:
        """Note that axes were halted or stopped: clients that jog one of them must press again."""
        for presses in self._clients.values():
            for axis in presses.held.keys() & set(axes):
                deadman, handle = presses.held[axis]
                presses.held[axis] = deadman.ended(), handle

    def _of(self, client: str) -> _Presses:
        presses = self._clients.setdefault(client, _Presses())
        self._clients.move_to_end(client)
        while len(self._clients) > _CLIENTS:
            self._clients.popitem(last=False)
        return presses

    @staticmethod
    def _broken(handle: Handle | None) -> AxisbusError | None:
        """Return the error that ended the last jog, unless the next jog of the same press replaced it, or its time ended."""
        error = None if handle is None or handle.busy else handle.exception()
        return None if isinstance(error, Replaced) else error


def _late_error() -> StateError:
    return StateError(
        "the jog has ended",
        observed=f"a query came more than {SILENCE:g} s late, or the axis was halted meanwhile",
        remedy=_PRESS_AGAIN,
    )
