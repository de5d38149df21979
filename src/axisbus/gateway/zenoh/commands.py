"""Commands of a fleet: stops from any client, all others from the holder of the lease; none is executed twice."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable

from axisbus.client_support.rate import Bucket
from axisbus.errors import ArgumentError, AxisbusError, StateError
from axisbus.fleet.messages import CommandAnswer, CommandAsk
from axisbus.gateway.zenoh.command_dedup import CommandDeduplicator, require_id
from axisbus.gateway.zenoh.command_table import JOG, STOPS, act_of
from axisbus.gateway.zenoh.deferred_replies import DeferredReplies, Reply
from axisbus.gateway.zenoh.execute import RUNNING, CommandExecutor, failed, perform
from axisbus.gateway.zenoh.jogs import Jogs
from axisbus.gateway.zenoh.lease_manager import Holding
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
        self._ledger: CommandDeduplicator[CommandExecutor] = CommandDeduplicator()
        self._jogs = Jogs()
        self._rate: tuple[str, Bucket] = "", Bucket()  # of the holder of the lease
        self._stops: OrderedDict[Hashable, CommandExecutor] = OrderedDict()

    def take(self, verb: str, ask: CommandAsk, reply: Reply) -> None:
        """Execute a command; ``reply`` is called at its end, in any thread, or after 2 s with ``running``."""
        try:
            if verb in STOPS:
                self._answers.put(self._stopped(verb, ask), reply)
                return
            with self._lock:
                found = self._done(verb, ask)
        except AxisbusError as error:
            reply(failed(error))
            return
        if isinstance(found, CommandAnswer):
            reply(found)
        else:
            self._answers.put(found, reply)

    def _stopped(self, verb: str, ask: CommandAsk) -> CommandExecutor:
        """Stop; a repeated stop counts as the same one only while it runs: the answer never comes from the cache."""
        act = act_of(verb, ask, tuple(self._machine.axes))
        key = verb, ask.client, ask.id, act.axes
        with self._lock:
            self._jogs.stopped(act.axes)
            if self._holding.lease.holds(ask.client, ask.token, self._clock()):
                self._ledger.passed(
                    ask.client, ask.id
                )  # an earlier command that arrives after it is too late
            under_way = self._stops.get(key)
            if under_way is not None and under_way.busy:
                return under_way
            self._stops[key] = doing = perform(self._machine, act)
            self._stops.move_to_end(key)
            while len(self._stops) > _STOPS:
                self._stops.popitem(last=False)
        return doing

    def _done(self, verb: str, ask: CommandAsk) -> CommandExecutor | CommandAnswer:
        _require_sound(ask)
        what = verb, ask.axes, tuple(sorted(ask.values.items())), ask.token
        again = None if verb == JOG else self._ledger.again(ask.client, ask.id, what)
        if again is not None:
            return again
        guest, now = self._commanded(ask)
        act = act_of(verb, ask, tuple(guest.axes))
        if verb == JOG:
            if self._ledger.passed(ask.client, ask.id):
                self._jogs.jog(guest, ask.client, act, now)
            return RUNNING
        doing = perform(guest, act)
        self._ledger.enter(ask.client, ask.id, what, doing)
        return doing

    def _commanded(self, ask: CommandAsk) -> tuple[Machine, float]:
        """Return the machine with control for the client of a command, and the time.

        Raises:
            OwnershipError: the client has no lease.
            StateError: the client sends too many commands.
        """
        now, lease, guest = self._clock(), self._holding.lease, self._holding.guest
        if guest is None or not lease.holds(ask.client, ask.token, now):
            raise lease.why_not(ask.client, ask.token, now)
        if self._rate[0] != lease.token:
            self._rate = lease.token, Bucket()
        if not self._rate[1].take(now):
            raise StateError(
                f"nothing was done: {lease.who} sends too many commands in too short a time",
                remedy="send at most 60 commands a second; halt and quick stop are always accepted",
            )
        return guest, now


def _require_sound(ask: CommandAsk) -> None:
    require_id(ask.id)
    if not ask.client or len(ask.client) > LONGEST:
        raise ArgumentError(
            "a client has no name, or its name is too long",
            remedy=f"at most {LONGEST} characters are allowed",
        )
