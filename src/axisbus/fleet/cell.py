"""One cell of a fleet, for programs: its state, axes, control, objects and recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, TypeVar

import msgspec

from axisbus.errors import ArgumentError, StateError, UnknownNameError
from axisbus.fleet.axis import FleetAxis
from axisbus.fleet.cell_state import LastAxisState
from axisbus.fleet.command_retry import error_of
from axisbus.fleet.command_sender import CommandSender
from axisbus.fleet.keys import ZenohCellKeys
from axisbus.fleet.lease_session import CellControl, Leases, no_answer
from axisbus.fleet.messages import (
    PROTOCOL,
    AxisInfo,
    CellInfo,
    Event,
    HistoryAnswer,
    HistoryAsk,
    ObjectAnswer,
    ObjectWrite,
    RecordingInfo,
    Value,
    read,
)
from axisbus.fleet.subscriptions import FleetSubscriptions
from axisbus.fleet.zenoh_client import ZenohClient
from axisbus.ipc.errors import ErrorFields
from axisbus.machine.handle import Handle

_TIMEOUT = 5.0  # seconds for an answer: reading an object of a node may take long
_Message = TypeVar("_Message")


class FleetServices(NamedTuple):
    """The parts of a fleet through which a cell is reached."""

    zenoh_client: ZenohClient
    subscriptions: FleetSubscriptions
    sender: CommandSender
    leases: Leases


class FleetCell:
    """A cell of a plant. Iterating yields its axes, ``cell["x"]`` is one of them. Any thread may use it."""

    name: str

    def __init__(self, name: str, ways: FleetServices) -> None:
        self.name = name
        self._services = ways
        self._keys = ZenohCellKeys(ways.subscriptions.plant, name)
        self._axes: dict[str, FleetAxis] = {}

    def __repr__(self) -> str:
        return f"<FleetCell {self.name}: {self.offline_reason or 'alive'}>"

    def __iter__(self) -> Iterator[FleetAxis]:
        return iter([self._axis(name) for name in self._axis_names()])

    def __getitem__(self, axis: str) -> FleetAxis:
        """Return the axis of this name.

        Raises:
            StateError: the cell has no axis of this name, or its axes are not known yet.
        """
        names = self._axis_names()
        if axis not in names:
            raise UnknownNameError(
                f"{self.name}: there is no axis {axis!r}",
                observed=f"there are {', '.join(names)}"
                if names
                else self.offline_reason or "its axes are not known yet",
                remedy="list the cells and axes: axisbus fleet list",
            )
        return self._axis(axis)

    def _axis(self, name: str) -> FleetAxis:
        return self._axes.setdefault(name, FleetAxis(name, self))

    def _axis_names(self) -> tuple[str, ...]:
        return self._services.subscriptions.inspect(self.name, lambda watch, _: watch.axes)

    # -- known state -----------------------------------------------------------------------------------------------------

    @property
    def axes(self) -> dict[str, FleetAxis]:
        """The axes by name, in the order of the cell file."""
        return {axis.name: axis for axis in self}

    @property
    def alive(self) -> bool:
        """Whether the cell's machine runs and its bridge is reached; false within a second of the loss of either."""
        return self._services.subscriptions.inspect(self.name, lambda watch, _: watch.alive)

    @property
    def bridge_online(self) -> bool:
        """Whether the cell's bridge is reached, even if no machine runs there."""
        return self._services.subscriptions.inspect(self.name, lambda watch, _: watch.bridged)

    @property
    def since(self) -> float:
        """The seconds for which this program has seen the cell alive, or gone."""
        return self._services.subscriptions.inspect(self.name, lambda watch, now: now - watch.since)

    @property
    def offline_reason(self) -> str:
        """Why the state of the cell is unknown now, as text for people; empty if the cell is alive."""
        if self.alive:
            return ""
        return (
            f"its machine does not run, for {self.since:.1f} s"
            if self.bridge_online
            else f"gone for {self.since:.1f} s"
        )

    @property
    def info(self) -> CellInfo | None:
        """The description of the cell from its bridge; None if it has not been received yet."""
        return self._services.subscriptions.inspect(self.name, lambda watch, _: watch.info)

    @property
    def version_mismatch(self) -> str:
        """How the cell's version of axisbus differs from the local one, for people; empty if it does not differ or is unknown."""
        return self._services.subscriptions.inspect(self.name, lambda watch, _: watch.differs)

    @property
    def duplicate_bridge(self) -> bool:
        """Whether two bridges use this name now; if so, this program sends the cell no command except stops."""
        return self._services.subscriptions.inspect(
            self.name, lambda watch, now: watch.has_second_bridge(now)
        )

    @property
    def clock_difference(self) -> float | None:
        """Seconds by which the clock of the cell's computer is ahead of the local one, less the message's delay; for people."""
        return self._services.subscriptions.inspect(self.name, lambda watch, _: watch.clock_difference)

    @property
    def events(self) -> list[Event]:
        """The newest events that are stored here, oldest first, at most 500."""
        return self._services.subscriptions.inspect(self.name, lambda watch, _: watch.log.events)

    @property
    def lost_events(self) -> int:
        """The number of events that are lost: this program missed them, and the cell no longer stores them."""
        return self._services.subscriptions.inspect(self.name, lambda watch, _: watch.log.lost)

    @property
    def incidents(self) -> list[Event]:
        """The events that report errors and warnings, oldest first, with cause and remedy if they are known."""
        return [event for event in self.events if event.kind == "incident" or event.severity != "info"]

    def last_state(self, axis: str) -> LastAxisState | None:
        """Return the last state that an axis reported, with its age and whether it is still valid; None if none was received."""
        return self._services.subscriptions.inspect(self.name, lambda watch, now: watch.last_state(axis, now))

    def axis_info(self, axis: str) -> AxisInfo | None:
        """Return the description of an axis in the cell file; None if it has not been received yet."""
        return self._services.subscriptions.inspect(self.name, lambda watch, _: watch.axis_info(axis))

    # -- control, and stops -----------------------------------------------------------------------------------------------

    def command(self, *, force: bool = False) -> CellControl[FleetCell]:
        """Take control of the cell, for a ``with`` block: entering the block takes the cell's lease, leaving it releases the lease.

        A thread renews the lease. If the renewal stops because this program is killed, stopped or cut off, the cell halts the axes
        that this program has moved, within about a second. The cell does the same at the end of the block. ``force``: take control
        from its present holder; moving axes are halted first. Entering usually blocks briefly (at most 7 s).

        Raises:
            OwnershipError: another program has control (on entering).
            StateError: the cell gives no answer, or this program already has control of it (on entering).
        """
        return CellControl(self, self.name, self._services.leases, force)

    def control_owner(self) -> str | None:
        """Return the name of the client that has control, for people, None if no client has it; blocks for at most 2 s.

        Raises:
            StateError: the cell gives no answer.
        """
        return self._services.leases.holder(self.name)

    def halt(self) -> Handle:
        """Brake all axes of the cell to Standstill, whichever client has control."""
        return self.stop_axes("halt_all", ())

    def quick_stop(self) -> Handle:
        """Make all drives of the cell do their quick stop, whichever client has control."""
        return self.stop_axes("quick_stop_all", ())

    def stop_axes(self, verb: str, axes: Sequence[str]) -> Handle:
        """Send a stop, which needs no lease; it is sent even if the cell seems to be gone."""
        name = ".".join((self.name, *axes, f"{verb.removesuffix('_all')}()"))
        return self._services.sender.send(self.name, verb, tuple(axes), {}, name, stops=True)

    def _send_command(self, verb: str, axes: Sequence[str], values: Mapping[str, Value], name: str) -> Handle:
        """Send a command that needs a lease.

        Raises:
            OwnershipError: this program does not have control of the cell.
            StateError: the cell speaks another version of the protocol, or two bridges use its name.
        """
        self._require_same_protocol(name)
        self._services.leases.require(self.name, name)
        return self._services.sender.send(self.name, verb, tuple(axes), values, name, once=verb == "jog")

    def _require_same_protocol(self, name: str) -> None:
        if self.duplicate_bridge:
            raise StateError(
                f"{name}: two bridges have the name {self.name}; nothing was sent",
                remedy="end one of them, or give it another name",
            )
        if self.info is not None and self.info.protocol != PROTOCOL:
            raise StateError(
                f"{name}: the cell has another protocol; nothing was sent",
                observed=self.version_mismatch,
                remedy="install the same version on both",
            )

    # -- objects and recordings ------------------------------------------------------------------------------------------

    def read_object(self, node: int, index: int, subindex: int = 0) -> Value | bytes:
        """Return the value of an object of a node, by its type in the EDS; blocks for at most 5 s.

        Raises:
            StateError: the cell gives no answer.
            AxisbusError: the error that the cell reports, such as ``SdoAbort`` if the node refuses.
        """
        return self._object(node, index, subindex, b"")

    def write_object(self, node: int, index: int, subindex: int, value: Value) -> None:
        """Write an object of a node; needs control of the cell; blocks for at most 5 s. Raises as ``read_object``.

        If there is no answer, it is unknown whether the object was written: read it.
        """
        name = f"{self.name}: node {node}, {index:04X}h:{subindex:02X}"
        self._services.leases.require(self.name, name)
        request = ObjectWrite(self._services.sender.client, self._services.sender.token(self.name), value)
        self._object(node, index, subindex, msgspec.json.encode(request))

    def _object(self, node: int, index: int, subindex: int, payload: bytes) -> Value | bytes:
        if not (0 <= index <= 0xFFFF and 0 <= subindex <= 0xFF):
            raise ArgumentError(f"{self.name}: there is no object {index!r}:{subindex!r}")
        answer = self._query(self._keys.object(node, index, subindex), payload, ObjectAnswer, "an object")
        self._require_no_error(answer.error, f"{self.name}: node {node}, {index:04X}h:{subindex:02X}")
        return bytes.fromhex(answer.hex) if answer.hex and answer.value is None else answer.value

    def recordings(self) -> list[RecordingInfo]:
        """Return the recordings that the cell stores; blocks for at most 5 s. Raises as ``read_object``."""
        return list(self._history(HistoryAsk()).recordings)

    def history(
        self,
        recording: str,
        signals: Sequence[str] = (),
        *,
        begin: float = 0.0,
        end: float | None = None,
        most: int = 10_000,
    ) -> HistoryAnswer:
        """Return samples of a recording: ``times`` (s from the first sample) and ``values`` by signal, such as ``x.position``.

        At most ``most`` samples are returned, evenly thinned out. Blocks for at most 5 s. Raises as ``read_object``.
        """
        return self._history(HistoryAsk(recording, tuple(signals), begin, end, most))

    def _history(self, request: HistoryAsk) -> HistoryAnswer:
        answer = self._query(self._keys.history, msgspec.json.encode(request), HistoryAnswer, "a recording")
        self._require_no_error(answer.error, f"{self.name}: its recordings")
        return answer

    def _query(self, key: str, payload: bytes, kind: type[_Message], what: str) -> _Message:
        answer = read(self._services.zenoh_client.query(key, payload, _TIMEOUT), kind)
        if answer is None:
            raise no_answer(f"{self.name}: {what}")
        return answer

    def _require_no_error(self, error: ErrorFields | None, what: str) -> None:
        if error is not None:
            raise error_of(error, what)
