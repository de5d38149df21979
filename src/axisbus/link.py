"""A link: the interface of a connection to drives, with which the core boots, cycles, rescues and leaves them.

Theory of operation
-------------------
The maker of a link opens it. It is then used in this order: ``boot`` for each node, ``begin`` once, ``cycle`` and ``ports`` by the
scan; ``parts`` for everything outside the scan; ``rescue`` only if the scan has failed; ``leave``, and ``close`` at the end. A node
may also be booted while the scan runs, because it was absent or has returned; ``admit`` then includes it in the cycle.
``core.canlink`` is CAN with CANopen, on an adapter or on a simulated wire in virtual time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from typing import Protocol, TypeVar

from axisbus.cia301.dropped_frames import Drop
from axisbus.cia301.frame import BusTraffic, CanFrame
from axisbus.cia301.sdo_counts import SdoCount
from axisbus.cia302.types import Address
from axisbus.cia401.port import IoPort
from axisbus.cia401.signal import IoPoint
from axisbus.cia402.port import BusCycle, Port
from axisbus.clock import Clock
from axisbus.errors import SecondMasterError

Booted = TypeVar("Booted", covariant=True)  # the result of booting a node
Parts = TypeVar("Parts", covariant=True)  # the parts for direct access to a node
Incident = TypeVar("Incident", covariant=True)  # an event of the adapter
Event = TypeVar("Event", covariant=True)  # a sign of another master


@dataclass(frozen=True, slots=True)
class StopResult:
    """The result of a stop without the scan: ``ok`` if the axis is at standstill or off, ``text`` in words."""

    axis: str
    ok: bool
    text: str


@dataclass(frozen=True, slots=True)
class Unsafe:
    """An output without a confirmed safe state; ``text`` says why, ``node`` is its node-ID."""

    output: str
    node: int
    text: str


def alarm(stopped: Iterable[StopResult]) -> str:
    """Return the warning about axes that may still move; empty if there are none."""
    unsure = [each.axis for each in stopped if not each.ok]
    return f"TREAT {', '.join(unsure)} AS MOVING: use the emergency stop" if unsure else ""


class NodeShutdown(Enum):
    """The final treatment of a node."""

    REST = "it no longer monitors the heartbeat of this program, and changes to pre-operational"
    AS_FOUND = (
        "it no longer monitors the heartbeat of this program, and keeps its NMT state: its drive was found enabled, "
        "not by this program"
    )
    ARMED = (
        "nothing: its standstill is not known, and its monitoring of the heartbeat remains active to stop it"
    )


class CellConnection(Protocol[Booted, Parts, Incident, Event]):
    """An opened connection to the nodes of a cell, identified by their node-IDs."""

    @property
    def clock(self) -> Clock:
        """The clock in which everything blocks; nodes are booted at the same time, each in a thread of this clock."""

    def boot(
        self,
        node_id: int,
        before: Mapping[Address, int] | None = None,
        on_step: Callable[[str], None] = lambda _: None,
    ) -> Booted:
        """Boot and configure a node, and return the result, an error included; blocks. ``on_step`` gets each step as it begins.

        ``before``: the identity (1018h) of the only device that may be booted, as far as devices report it; None: any that fits the
        cell file.
        """

    def begin(self) -> None:
        """Make the cycle, with the nodes that have come up."""

    def admit(self, node_id: int) -> None:
        """Include a node that was booted while the scan runs in the cycle; its earlier ports end. Only for the scan's thread."""

    @property
    def cycle(self) -> BusCycle:
        """The cycle, which sets the pace of the scan and transports its frames; available after ``begin``."""

    def ports(self, node_id: int) -> Mapping[str, Port]:
        """Return the ports of a node's axes, by name; empty if the node has not come up."""

    def io(self, node_id: int) -> IoPort | None:
        """Return the inputs and outputs of a node; None if the cell names none of its inputs and outputs, or leaves it as it is."""

    def parts(self, node_id: int) -> Parts:
        """Return the parts for direct access to a node, even if the node has not come up."""

    def answers(self, node_id: int) -> bool:
        """Whether a node answers now; also False if a stop takes the place of the request. Blocks for one request."""

    def ready(self) -> None:
        """Block until the scan may begin its first cycle, for example for another device's SYNC; raises as ``BusCycle``."""

    def rescue(self, names: Collection[str]) -> list[StopResult]:
        """Stop the axes of these names without the scan, and return the result of each; blocks."""

    def make_safe(self, points: Collection[IoPoint]) -> list[Unsafe]:
        """Set outputs to their safe states without the scan, and return those without confirmation; blocks."""

    def require_reconnectable(self, scan_failed: bool) -> None:
        """Check that ``reconnect`` makes sense; raises StateError. ``scan_failed``: the adapter's failure has ended the scan."""

    def reconnect(self, listen: bool = True) -> None:
        """Open the adapter again after it has failed, or is bus-off, with the same nodes; blocks.

        Every node counts as lost until it is heard again. ``listen``: for another master, before anything is sent.

        Raises AdapterError, SecondMasterError; it may be called again.
        """

    def leave(self, how: Mapping[int, NodeShutdown]) -> None:
        """Leave each node as ``how`` says; blocks. A node that is gone is skipped."""

    def close(self) -> None:
        """Release everything."""

    def bus_time(self, now: float) -> datetime | None:
        """Return the time of another device's TIME at ``now`` (monotonic seconds), None if none was received."""

    def incidents(self) -> Sequence[Incident]:
        """Return the events of the adapter, oldest first."""

    def other_masters(self) -> Sequence[Event]:
        """Return the signs of another master since ``begin``, oldest first."""

    def on_command_of_others(self, call: Callable[[SecondMasterError, frozenset[int]], None]) -> None:
        """Register ``call``, in any thread, for nodes that another master commands, with the error that describes it."""

    def drops(self) -> Sequence[Drop]:
        """Return the dropped frames."""

    def sdo_counts(self) -> Sequence[SdoCount]:
        """Return the results of SDO transfers, by node; empty if there are no frames."""

    def carried(self) -> BusTraffic | None:
        """Return the traffic of the bus so far; None if there are no frames."""

    def tap(self, handler: Callable[[CanFrame], None]) -> None:
        """Call ``handler`` with every frame, in either direction; it must not block. Never called if there are no frames."""

    def untap(self, handler: Callable[[CanFrame], None]) -> None:
        """End the tap; harmless if it has ended."""
