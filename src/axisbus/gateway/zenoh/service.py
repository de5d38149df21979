"""The queries that a cell answers while its machine runs: description, states, lease, commands, objects."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import TypeVar

import msgspec
import zenoh

from axisbus.errors import ArgumentError, AxisbusError
from axisbus.fleet.keys import ZenohCellKeys
from axisbus.fleet.messages import (
    CellInfo,
    CommandAnswer,
    CommandAsk,
    LeaseAnswer,
    LeaseAsk,
    ObjectWrite,
)
from axisbus.gateway.zenoh import objects
from axisbus.gateway.zenoh.command_table import ALL, STOPS
from axisbus.gateway.zenoh.commands import LONGEST, Commands
from axisbus.gateway.zenoh.execute import failed
from axisbus.gateway.zenoh.lease_manager import Holding
from axisbus.gateway.zenoh.objects import TransferWorker, answer_of
from axisbus.gateway.zenoh.publishing import States
from axisbus.ipc.errors import to_fields
from axisbus.machine.machine import Machine
from axisbus.wording import counted

# -- Queries of Zenoh for this protocol: decoded with limited size, and answered once --------------------------------------

log = logging.getLogger("axisbus")
LARGEST = 8192  # bytes of a query
Message = TypeVar("Message", bound=msgspec.Struct)
_JSON = zenoh.Encoding.APPLICATION_JSON


class ZenohQuery:
    """One query; to be answered or dropped, by any thread."""

    def __init__(self, raw_query: zenoh.Query) -> None:
        self._query = raw_query
        self.key = str(raw_query.key_expr)

    @property
    def concrete(self) -> bool:
        """Whether it names exactly one key."""
        return "*" not in self.key and "$" not in self.key

    def intersects(self, key: str) -> bool:
        """Whether it matches a key."""
        return self._query.key_expr.intersects(key)

    def parameter(self, name: str) -> str | None:
        """Return a parameter of its selector."""
        return self._query.parameters.get(name)

    @property
    def data(self) -> bytes:
        """The payload; empty if there is none.

        Raises:
            ArgumentError: the payload is too large.
        """
        payload = self._query.payload
        if payload is None:
            return b""
        if len(payload) > LARGEST:
            raise ArgumentError(
                "the query is too large",
                observed=f"it has {counted(len(payload), 'byte')}, and at most {LARGEST} are allowed",
            )
        return payload.to_bytes()

    def message(self, kind: type[Message]) -> Message:
        """Return the payload as a message.

        Raises:
            ArgumentError: the payload is not a message of this kind.
        """
        try:
            return msgspec.json.decode(self.data, type=kind)
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            raise ArgumentError(
                f"the query does not contain a {kind.__name__} of this protocol", observed=str(error)
            ) from error

    def answer(self, key: str, message: msgspec.Struct, *, last: bool = True) -> None:
        """Answer on a key; ``last``: there is no further answer. Errors are ignored, because the client may be gone."""
        try:
            self._query.reply(key, msgspec.json.encode(message), encoding=_JSON)
        except Exception as error:  # noqa: BLE001  # the client or the session is gone
            log.debug("an answer on %s could not be executed: %s", key, error)
        if last:
            self.drop()

    def drop(self) -> None:
        """Drop the query; harmless when repeated."""
        try:
            self._query.drop()  # type: ignore[no-untyped-call]
        except Exception as error:  # noqa: BLE001
            log.debug("a query could not be closed: %s", error)


def guarded(handler: Callable[[ZenohQuery], None]) -> Callable[[zenoh.Query], None]:
    """Return a callback of a queryable that survives any error in a query."""

    def on_query(raw_query: zenoh.Query) -> None:
        query = ZenohQuery(raw_query)
        try:
            handler(query)
        except Exception as error:  # noqa: BLE001
            log.warning("a query on %s could not be processed: %s", query.key, error)
            query.drop()

    return on_query


# -- The queries that a cell answers ---------------------------------------------------------------------------------------


class ZenohService:
    """Hold the queryables of a machine; each is processed in a thread of its own, and none waits for the machine."""

    def __init__(
        self,
        session: zenoh.Session,
        keys: ZenohCellKeys,
        machine: Machine,
        holding: Holding,
        commands: Commands,
        states: States,
        transfers: TransferWorker,
        info: Callable[[], CellInfo],
        commander: Callable[[], str | None],
    ) -> None:
        """``commander``: returns the program that has control of the machine, for people, if no client on the network has it."""
        self._keys = keys
        self._machine = machine
        self._holding = holding
        self._commands = commands
        self._states = states
        self._transfers = transfers
        self._info = info
        self._commander = commander
        self._declared = ExitStack()
        handlers: dict[str, Callable[[ZenohQuery], None]] = {
            keys.info: lambda query: query.answer(keys.info, self._info()),
            keys.state("*"): self._state,
            keys.lease: self._lease,
            keys.objects: self._object,
            **{
                keys.command(verb): self._command for verb in STOPS
            },  # so that a flood of other commands delays no stop
            keys.command("*"): self._command_but_stops,
        }
        for key, handler in handlers.items():
            queryable = session.declare_queryable(key, guarded(handler))
            self._declared.callback(queryable.undeclare)

    def close(self) -> None:
        """Answer no more queries; blocks briefly."""
        self._declared.close()

    def _state(self, query: ZenohQuery) -> None:
        for axis in self._machine.axes:
            if query.intersects(self._keys.state(axis)):
                query.answer(self._keys.state(axis), self._states.of(axis), last=False)
        query.drop()

    # -- commands ------------------------------------------------------------------------------------------------------

    def _command_but_stops(self, query: ZenohQuery) -> None:
        if query.key.rpartition("/")[2] in STOPS or not query.concrete:
            query.drop()  # a stop has its own queryable, and only a stop may address several cells
        else:
            self._command(query)

    def _command(self, query: ZenohQuery) -> None:
        verb = query.key.rpartition("/")[2]
        key = self._keys.command(verb)
        if "*" in verb or "$" in verb:
            query.drop()
            return
        try:
            message = _stop(verb, query) if verb in STOPS else query.message(CommandAsk)
        except AxisbusError as error:
            query.answer(key, failed(error))
            return

        def reply(answer: CommandAnswer) -> None:
            query.answer(key, answer)

        self._commands.execute(verb, message, reply)

    # -- the lease -----------------------------------------------------------------------------------------------------

    def _lease(self, query: ZenohQuery) -> None:
        received = time.monotonic()

        def reply_lease(client: str = "", error: AxisbusError | None = None) -> None:
            query.answer(self._keys.lease, self._lease_state(client, error, received))

        if not query.concrete:
            reply_lease()
            return
        try:
            message = query.message(LeaseAsk)
            _require_name(message)
        except AxisbusError as error:
            reply_lease(error=error)
            return
        if message.verb == "take":
            self._holding.take(
                message.client,
                message.who,
                message.over,
                lambda refused: reply_lease(message.client, refused),
            )
        elif message.verb == "look":
            reply_lease()
        else:
            change = self._holding.renew if message.verb == "renew" else self._holding.release
            refused = change(message.client, message.token)
            reply_lease(message.client if refused is None else "", refused)

    def _lease_state(self, client: str, error: AxisbusError | None, received: float) -> LeaseAnswer:
        """Return the state of the lease; with its token only for ``client``, if that client has it.

        Its seconds count from the arrival of the query. The client counts from the sending, and so its lease ends earlier than
        here.
        """
        lease = self._holding.lease
        token = lease.token if client and error is None and lease.client == client else ""
        holder = lease.holder or self._commander()
        return LeaseAnswer(
            holder, lease.seconds(received), token, None if error is None else to_fields(error)
        )

    # -- objects -------------------------------------------------------------------------------------------------------

    def _object(self, query: ZenohQuery) -> None:
        if not query.concrete:
            query.drop()  # one query must not cause a transfer for each object of each node
            return
        try:
            node, index, subindex = _object_of(query.key)
            write = query.message(ObjectWrite) if query.data else None
            machine = self._machine if write is None else self._with_control(write)
        except AxisbusError as error:
            query.answer(query.key, answer_of(error))
            return
        if write is None:
            self._transfers.put(
                lambda: objects.read(machine, node, index, subindex),
                lambda answer: query.answer(query.key, answer),
            )
            return
        value = write.value
        self._transfers.put(
            lambda: objects.write(machine, node, index, subindex, value),
            lambda answer: query.answer(query.key, answer),
        )

    def _with_control(self, write: ObjectWrite) -> Machine:
        now, lease, controlled = time.monotonic(), self._holding.lease, self._holding.controlled
        if controlled is None or not lease.holds(write.client, write.token, now):
            raise lease.why_not(write.client, write.token, now)
        return controlled


class _Stop(msgspec.Struct, frozen=True):
    """The fields of a stop that are read."""

    client: str = ""
    id: int = 0
    token: str = ""
    axes: tuple[str, ...] = ()


def _stop(verb: str, query: ZenohQuery) -> CommandAsk:
    """Return a stop as a command; no field but its axes can invalidate it, and a stop of all axes is always valid."""
    all_axes = verb.endswith(ALL)
    try:
        found = query.message(_Stop) if query.data else _Stop()
    except AxisbusError:
        if not all_axes:
            raise
        found = _Stop()
    return CommandAsk(found.client, found.id, found.token, () if all_axes else found.axes)


def _require_name(message: LeaseAsk) -> None:
    if not 0 < len(message.client) <= LONGEST or len(message.who) > LONGEST:
        raise ArgumentError(
            "a client has no name, or its name is too long",
            remedy=f"at most {LONGEST} characters are allowed",
        )


def _object_of(key: str) -> tuple[int, int, int]:
    """Return node, index and sub-index from the end of a key.

    Raises:
        ArgumentError: they are invalid.
    """
    node, index, subindex = key.split("/")[-3:]
    try:
        found = int(node), int(index, 16), int(subindex, 16)
    except ValueError:
        found = -1, -1, -1
    if not (0 < found[0] < 128 and 0 <= found[1] <= 0xFFFF and 0 <= found[2] <= 0xFF):
        raise ArgumentError(
            f"{'/'.join((node, index, subindex))} is not an object", remedy="write od/1/6041/00"
        )
    return found
