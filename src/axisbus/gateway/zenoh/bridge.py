"""The bridge of a cell: it follows the machine that runs, one after the other, and is known on the network as long as it runs."""

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

_LOOK = 0.05  # seconds between two looks whether the machine is there still
_ROS = "a trajectory of ROS 2"  # who has the command, for people
_RIVALS = 1.0  # seconds in which another bridge of the same name answers


class Cell(NamedTuple):
    """What a bridge is of: the cell's file, its keys, the folder of recordings that are shown, and what ROS 2 is to have."""

    file: Path
    keys: ZenohCellKeys
    recordings: Path | None = None
    ros: RosOptions | None = None


class Bridge:
    """Holds what of a bridge outlives a machine: its name, its events, and the recordings. ``run`` is for the main thread."""

    def __init__(self, session: zenoh.Session, cell: Cell, say: Callable[[str], None]) -> None:
        """Be there on the network; blocks for some seconds. ``say`` tells people how it goes.

        Raises:
            StateError: another bridge is there under the same name.
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
        """Be there no more; blocks for a moment."""
        self._stack.close()

    def run(self) -> None:
        """Follow the machine that runs, and the next one where it ends, until it is interrupted."""
        MachineFollower(self._cell.file, self._say).run(self._served, _LOOK)

    # -- who is there --------------------------------------------------------------------------------------------------

    def _be_there(self, stack: ExitStack) -> None:
        """Declare that this bridge is there, unless another one is."""
        self._require_alone(set())
        token = self._session.liveliness().declare_token(self._cell.keys.presence(self._name))
        stack.callback(token.undeclare)
        self._require_alone({self._name})  # of two that came at once only the first in the alphabet stays
        others = self._session.liveliness().declare_subscriber(self._cell.keys.presence("*"), self._heard)
        stack.callback(others.undeclare)

    def _require_alone(self, own: set[str]) -> None:
        found = self._session.liveliness().get(self._cell.keys.presence("*"), timeout=_RIVALS)
        names = {str(reply.ok.key_expr).rpartition("/")[2] for reply in found if reply.ok is not None}
        others = names - own
        if others and (not own or min(others) < min(own)):
            raise StateError(
                f"another bridge of {self._cell.keys.base} is on this network already",
                remedy="end that one, or give this cell another name: --cell NAME",
            )

    def _heard(self, sample: zenoh.Sample) -> None:
        """Tell where another bridge of this name has come, over a connection that was not there before."""
        other = str(sample.key_expr).rpartition("/")[2]
        if sample.kind == zenoh.SampleKind.PUT and other != self._name:
            text = f"another bridge of {self._cell.keys.base} is on this network too: end one of them"
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
        """Have a machine on the network, and tell that it came, and why it ended."""
        with ExitStack() as stack:
            self._serve(machine, stack)
            self._events.tell(Happened("machine", "a machine runs, and the bridge has joined it"))
            yield lambda: None
            why = machine.session.dead or machine.session.leaving_because or "it was ended"
            self._events.tell(Happened("machine", f"the machine has ended: {why}", severity="warning"))

    def _serve(self, machine: Machine, stack: ExitStack) -> None:
        """Declare all that there is of a machine, and at last that it is alive; on the way out in the other order."""
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
        """Have its joints in ROS 2, where that is asked for; return what tells whether a trajectory has the machine's command."""
        if self._cell.ros is None:
            return lambda: None
        from axisbus.gateway.ros.node import RosNodes  # only this has packages of ROS 2

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
