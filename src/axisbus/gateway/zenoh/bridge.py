"""The bridge of a cell: it follows one running machine after the other, and offers it on the network while it runs."""

from __future__ import annotations

import secrets
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import zenoh

from axisbus.errors import AxisbusError, StateError
from axisbus.fleet.keys import ZenohCellKeys
from axisbus.fleet.messages import PROTOCOL, CellInfo, EventsAsk, HistoryAsk
from axisbus.gateway.machine_follower import Look, MachineFollower
from axisbus.gateway.zenoh.commands import Commands
from axisbus.gateway.zenoh.deferred_replies import DeferredReplies
from axisbus.gateway.zenoh.event_log import Happened
from axisbus.gateway.zenoh.history import RecordingsWorker, refused
from axisbus.gateway.zenoh.lease_manager import Holding
from axisbus.gateway.zenoh.objects import TransferWorker
from axisbus.gateway.zenoh.poller import MachinePoller
from axisbus.gateway.zenoh.publishing import Counts, EventPublisher, States
from axisbus.gateway.zenoh.query import ZenohQuery, heard
from axisbus.gateway.zenoh.service import ZenohService
from axisbus.gateway.zenoh.states import info_of
from axisbus.machine.machine import Machine
from axisbus.version import __version__

if TYPE_CHECKING:
    from axisbus.gateway.ros.node import RosOptions

_LOOK = 0.05  # seconds between two checks whether the machine still runs
_ROS = "a trajectory of ROS 2"  # the holder of control, for people
_RIVALS = 1.0  # seconds within which another bridge of the same name answers


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
            self._be_there(stack)
            history = RecordingsWorker(cell.recordings)
            stack.callback(history.close)
            self._answer(stack, cell.keys.events, self._missing)
            self._answer(stack, cell.keys.history, lambda asked: _history(history, cell.keys, asked))
            self._stack = stack.pop_all()

    def close(self) -> None:
        """Leave the network; blocks briefly."""
        self._stack.close()

    def run(self) -> None:
        """Follow the running machine, and the next one when it ends, until interrupted."""
        MachineFollower(self._cell.file, self._say).run(self._served, _LOOK)

    # -- presence ------------------------------------------------------------------------------------------------------

    def _be_there(self, stack: ExitStack) -> None:
        """Declare the presence of this bridge, unless another one is present."""
        self._require_alone(set())
        token = self._session.liveliness().declare_token(self._cell.keys.presence(self._name))
        stack.callback(token.undeclare)
        self._require_alone({self._name})  # of two that start at once, only the alphabetically first stays
        others = self._session.liveliness().declare_subscriber(self._cell.keys.presence("*"), self._heard)
        stack.callback(others.undeclare)

    def _require_alone(self, own: set[str]) -> None:
        found = self._session.liveliness().get(self._cell.keys.presence("*"), timeout=_RIVALS)
        names = {str(reply.ok.key_expr).rpartition("/")[2] for reply in found if reply.ok is not None}
        others = names - own
        if others and (not own or min(others) < min(own)):
            raise StateError(
                f"another bridge of {self._cell.keys.base} is already on this network",
                remedy="end that bridge, or give this cell another name: --cell NAME",
            )

    def _heard(self, sample: zenoh.Sample) -> None:
        """Report another bridge of this name that has appeared over a new connection."""
        other = str(sample.key_expr).rpartition("/")[2]
        if sample.kind == zenoh.SampleKind.PUT and other != self._name:
            text = f"another bridge of {self._cell.keys.base} is also on this network: end one of them"
            self._say(text)
            self._events.tell(Happened("machine", text, severity="error"))

    def _answer(self, stack: ExitStack, key: str, take: Callable[[ZenohQuery], None]) -> None:
        queryable = self._session.declare_queryable(key, heard(take))
        stack.callback(queryable.undeclare)

    def _missing(self, asked: ZenohQuery) -> None:
        keys = self._cell.keys
        try:
            ask = asked.message(EventsAsk) if asked.data else _numbers(asked)
        except (AxisbusError, ValueError):
            ask = EventsAsk()
        asked.answer(keys.events, self._events.kept.answer(ask))

    # -- one machine ---------------------------------------------------------------------------------------------------

    @contextmanager
    def _served(self, machine: Machine) -> Iterator[Look]:
        """Offer a machine on the network, and report its start and the reason of its end."""
        with ExitStack() as stack:
            self._serve(machine, stack)
            self._events.tell(Happened("machine", "a machine runs, and the bridge has joined it"))
            yield lambda: None
            why = machine.session.dead or machine.session.leaving_because or "it was ended"
            self._events.tell(Happened("machine", f"the machine has ended: {why}", severity="warning"))

    def _serve(self, machine: Machine, stack: ExitStack) -> None:
        """Declare everything about a machine, and finally that it is alive; undeclared in reverse order."""
        keys, file = self._cell.keys, self._cell.file
        transfers, answers = TransferWorker(), DeferredReplies()
        stack.callback(transfers.close)
        stack.callback(answers.close)
        holding = Holding(lambda over: Machine.attach(file, command=True, force=over), self._events.tell)
        holding.start()
        stack.callback(holding.close)
        looking = MachinePoller(machine, holding, self._events.tell)
        looking.start()
        stack.callback(looking.close)
        states = States(self._session, keys, self._name, machine, looking.wake, self._counts)
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
            lambda: looking.commander or trajectories(),
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


def _numbers(asked: ZenohQuery) -> EventsAsk:
    last = asked.parameter("last")
    return EventsAsk(int(asked.parameter("first") or 1), None if last is None else int(last))


def _history(history: RecordingsWorker, keys: ZenohCellKeys, asked: ZenohQuery) -> None:
    try:
        ask = asked.message(HistoryAsk) if asked.data else HistoryAsk()
    except AxisbusError as error:
        asked.answer(keys.history, refused(error))
        return
    history.put(ask, lambda answer: asked.answer(keys.history, answer))
