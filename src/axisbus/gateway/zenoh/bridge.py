"""The bridge of a cell: it follows one running machine after the other, and offers it on the network while it runs."""

from __future__ import annotations

import logging
import os
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import zenoh

from axisbus.errors import AxisbusError, StateError
from axisbus.fleet.keys import ZenohCellKeys
from axisbus.fleet.messages import PROTOCOL, CellInfo, EventsAsk, HistoryAsk
from axisbus.gateway import machine_events
from axisbus.gateway.machine_events import MachineEvent, MachineEventSource
from axisbus.gateway.machine_follower import MachineFollower, Poll
from axisbus.gateway.zenoh.commands import Commands
from axisbus.gateway.zenoh.execute import DeferredReplies, without_process
from axisbus.gateway.zenoh.history import RecordingsWorker, refused
from axisbus.gateway.zenoh.lease_manager import Holding
from axisbus.gateway.zenoh.objects import TransferWorker
from axisbus.gateway.zenoh.publishing import BridgeEvent, Counts, EventPublisher, Kind, States, info_of
from axisbus.gateway.zenoh.service import ZenohQuery, ZenohService, guarded
from axisbus.machine.machine import Machine
from axisbus.version import __version__

if TYPE_CHECKING:
    from axisbus.gateway.ros.node import RosOptions


_POLL_PERIOD = 0.05  # seconds between two checks whether the machine still runs
_ROS = "a trajectory of ROS 2"  # the holder of control, for people
_DUPLICATE_TIMEOUT = 1.0  # seconds within which another bridge of the same name answers


class Cell(NamedTuple):
    """The subject of a bridge: the cell file, its keys, the folder of its public recordings, and the options for ROS 2."""

    file: Path
    keys: ZenohCellKeys
    recordings: Path | None = None
    ros: RosOptions | None = None


class Bridge:
    """Hold the state of a bridge that outlives a machine: its name, events, and recordings. ``run`` is for the main thread."""

    def __init__(self, session: zenoh.Session, cell: Cell, say: Callable[[str], None]) -> None:
        """Register on the network; blocks for some seconds. ``say`` reports to people.

        Raises:
            StateError: another bridge of the same name is present.
        """
        self._session = session
        self._cell = cell
        self._say = say
        self._name = secrets.token_hex(6)
        self._counts: Counts = {}
        self._stack = ExitStack()
        with ExitStack() as stack:
            self._events = EventPublisher(session, cell.keys, self._name)
            stack.callback(self._events.close)
            self._declare_presence(stack)
            history = RecordingsWorker(cell.recordings)
            stack.callback(history.close)
            self._answer(stack, cell.keys.events, self._missing)
            self._answer(stack, cell.keys.history, lambda query: _history(history, cell.keys, query))
            self._stack = stack.pop_all()

    def close(self) -> None:
        """Leave the network; blocks briefly."""
        self._stack.close()

    def run(self) -> None:
        """Follow the running machine, and the next one when it ends, until interrupted."""
        MachineFollower(self._cell.file, self._say).run(self._served, _POLL_PERIOD)

    # -- presence ------------------------------------------------------------------------------------------------------

    def _declare_presence(self, stack: ExitStack) -> None:
        """Declare the presence of this bridge, unless another one is present."""
        self._require_no_duplicate(set())
        token = self._session.liveliness().declare_token(self._cell.keys.presence(self._name))
        stack.callback(token.undeclare)
        self._require_no_duplicate(
            {self._name}
        )  # of two that start at once, only the alphabetically first stays
        others = self._session.liveliness().declare_subscriber(
            self._cell.keys.presence("*"), self._on_presence
        )
        stack.callback(others.undeclare)

    def _require_no_duplicate(self, own: set[str]) -> None:
        found = self._session.liveliness().get(self._cell.keys.presence("*"), timeout=_DUPLICATE_TIMEOUT)
        names = {str(reply.ok.key_expr).rpartition("/")[2] for reply in found if reply.ok is not None}
        others = names - own
        if others and (not own or min(others) < min(own)):
            raise StateError(
                f"another bridge of {self._cell.keys.base} is already on this network",
                remedy="end that bridge, or give this cell another name: --cell NAME",
            )

    def _on_presence(self, sample: zenoh.Sample) -> None:
        """Report another bridge of this name that has appeared over a new connection."""
        other = str(sample.key_expr).rpartition("/")[2]
        if sample.kind == zenoh.SampleKind.PUT and other != self._name:
            text = f"another bridge of {self._cell.keys.base} is also on this network: end one of them"
            self._say(text)
            self._events.publish(BridgeEvent("machine", text, severity="error"))

    def _answer(self, stack: ExitStack, key: str, handler: Callable[[ZenohQuery], None]) -> None:
        queryable = self._session.declare_queryable(key, guarded(handler))
        stack.callback(queryable.undeclare)

    def _missing(self, query: ZenohQuery) -> None:
        keys = self._cell.keys
        try:
            request = query.message(EventsAsk) if query.data else _numbers(query)
        except (AxisbusError, ValueError):
            request = EventsAsk()
        query.answer(keys.events, self._events.stored.answer(request))

    # -- one machine ---------------------------------------------------------------------------------------------------

    @contextmanager
    def _served(self, machine: Machine) -> Iterator[Poll]:
        """Offer a machine on the network, and report its start and the reason of its end."""
        with ExitStack() as stack:
            self._serve(machine, stack)
            self._events.publish(BridgeEvent("machine", "a machine runs, and the bridge has joined it"))
            yield lambda: None
            why = machine.session.dead or machine.session.leaving_because or "it was ended"
            self._events.publish(BridgeEvent("machine", f"the machine has ended: {why}", severity="warning"))

    def _serve(self, machine: Machine, stack: ExitStack) -> None:
        """Declare everything about a machine, and finally that it is alive; undeclared in reverse order."""
        keys, file = self._cell.keys, self._cell.file
        transfers, answers = TransferWorker(), DeferredReplies()
        stack.callback(transfers.close)
        stack.callback(answers.close)
        holding = Holding(lambda force: Machine.attach(file, command=True, force=force), self._events.publish)
        holding.start()
        stack.callback(holding.close)
        poller = MachinePoller(machine, holding, self._events.publish)
        poller.start()
        stack.callback(poller.close)
        states = States(self._session, keys, self._name, machine, poller.wake, self._counts)
        states.start()
        stack.callback(states.close)
        trajectories = self._serve_ros(machine, stack)
        service = ZenohService(
            self._session,
            keys,
            machine,
            holding,
            Commands(machine, holding, answers),
            states,
            transfers,
            lambda: self._info(machine),
            lambda: poller.commander or trajectories(),
        )
        stack.callback(service.close)
        token = self._session.liveliness().declare_token(keys.alive)
        stack.callback(token.undeclare)

    def _serve_ros(self, machine: Machine, stack: ExitStack) -> Callable[[], str | None]:
        """Offer its joints in ROS 2 if requested; return a function that returns the holder of control if a trajectory has it."""
        if self._cell.ros is None:
            return lambda: None
        from axisbus.gateway.ros.node import RosNodes  # only this module needs packages for ROS 2

        nodes = RosNodes(self._session, machine, self._cell.file, self._cell.ros, self._say)
        stack.callback(nodes.close)
        return lambda: _ROS if nodes.commands else None

    def _info(self, machine: Machine) -> CellInfo:
        keys, cell = self._cell.keys, machine.cell
        return CellInfo(
            PROTOCOL,
            __version__,
            self._name,
            keys.plant,
            keys.cell,
            time.time(),
            machine.is_simulated,
            tuple(info_of(axis, cell.axes[axis.name].node or None) for axis in machine),
            {name: tuple(group.axes) for name, group in cell.groups.items()},
            tuple(cell.nodes),
            socket.gethostname(),
        )


def _numbers(query: ZenohQuery) -> EventsAsk:
    last = query.parameter("last")
    return EventsAsk(int(query.parameter("first") or 1), None if last is None else int(last))


def _history(history: RecordingsWorker, keys: ZenohCellKeys, query: ZenohQuery) -> None:
    try:
        request = query.message(HistoryAsk) if query.data else HistoryAsk()
    except AxisbusError as error:
        query.answer(keys.history, refused(error))
        return
    history.put(request, lambda answer: query.answer(keys.history, answer))


# -- Poll a machine for its events, and for the program that has control -----------------------------------------------


log = logging.getLogger("axisbus")
_EVENT_POLL_PERIOD = 0.25  # seconds
_MIN_PAUSE = 0.05  # seconds between two polls, even if there is always something new
_STAMP_TOLERANCE = 1e-3  # seconds by which the time stamps of a list may differ


class MachinePoller:
    """Poll in a thread of its own, which may wait for answers of the core; ``wake`` is for any thread."""

    def __init__(self, machine: Machine, holding: Holding, publish: Callable[[BridgeEvent], None]) -> None:
        self._machine = machine
        self._holding = holding
        self._publish = publish
        self._event_source = MachineEventSource(time.monotonic() - _STAMP_TOLERANCE, commands=True)
        self._woken = threading.Event()
        self._closing = False
        self._commander: str | None = None
        self._thread = threading.Thread(target=self._run, name="looking", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def wake(self) -> None:
        """Poll now; does not block."""
        self._woken.set()

    def close(self) -> None:
        """Poll once more, and end; blocks briefly."""
        self._closing = True
        self._woken.set()
        self._thread.join(2.0)

    @property
    def commander(self) -> str | None:
        """The program at the machine that has control, other than this one; as of the last poll."""
        return self._commander

    def _run(self) -> None:
        while not self._closing:
            self._woken.wait(_EVENT_POLL_PERIOD)
            self._woken.clear()
            try:
                self._poll()
            except AxisbusError as error:  # the machine has ended, or is about to
                log.debug("the machine could not be observed: %s", error)
            except Exception:
                log.exception("an observation of the machine failed")
            time.sleep(_MIN_PAUSE)

    def _poll(self) -> None:
        for event in bridge_events(self._event_source.poll(self._machine, time.monotonic())):
            self._publish(event)
        own = f"process {os.getpid()} "
        who = next((each.who for each in self._machine.programs if each.commands), None)
        self._commander = None if who is None or own in who else who
        controlled = self._holding.controlled
        if controlled is not None and not controlled.has_control:
            self._holding.lost(f"{who or 'another program'} took control of the machine")


# -- Map the events of a machine to events for the network: without the name of this process, and by kind --------------


# Other kinds are not reported: of an incident, only its beginning and its end are.
KINDS: dict[machine_events.MachineEventKind, Kind] = {
    machine_events.MachineEventKind.COMMAND: "command",
    machine_events.MachineEventKind.NODE: "node",
    machine_events.MachineEventKind.BUS: "bus",
    machine_events.MachineEventKind.LEFT: "machine",
    machine_events.MachineEventKind.EMCY: "emcy",
    machine_events.MachineEventKind.INCIDENT: "incident",
    machine_events.MachineEventKind.OVER: "incident",
    machine_events.MachineEventKind.FAULT: "incident",
    machine_events.MachineEventKind.WELL: "incident",
}


def bridge_events(found: Iterable[MachineEvent]) -> list[BridgeEvent]:
    """Return the events to report, in their order."""
    return [
        BridgeEvent(
            KINDS[one.kind],
            without_process(one.text),
            one.about,
            one.severity,
            without_process("; ".join(one.cause)),
            one.remedy,
        )
        for one in found
        if one.kind in KINDS
    ]
