"""A link: what a kind of connection to drives has to offer, so that the core can boot, cycle, rescue and leave them.

Theory of operation
-------------------
A link is opened by whoever makes it, and then used in this order: ``boot`` for each node, ``begin`` once, ``cycle`` and ``ports``
by the scan; ``parts`` for everything beside the scan; ``rescue`` only where the scan has failed; ``leave``, and ``close`` at the
end. A node that was not there may be booted later, while the scan runs: the cycle serves it from then on. CAN with CANopen is
``core.canlink``; simulated drives in virtual time, without a bus, are ``core.direct``.
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
from axisbus.cia401.port import IoPort
from axisbus.cia401.signal import IoPoint
from axisbus.cia402.port import BusCycle, Port
from axisbus.errors import SecondMasterError

Booted = TypeVar("Booted", covariant=True)  # what booting a node has come to
Parts = TypeVar("Parts", covariant=True)  # what direct access to a node is made of
Incident = TypeVar("Incident", covariant=True)  # what the adapter has told
Event = TypeVar("Event", covariant=True)  # what was heard of another master


@dataclass(frozen=True, slots=True)
class StopResult:
    """How a stop without the scan left an axis: ``ok`` when it stands or is off, ``text`` in words."""

    axis: str
    ok: bool
    text: str


@dataclass(frozen=True, slots=True)
class Unsafe:
    """An output that is not confirmed to be in its safe state; ``text`` says why, ``node`` where it is."""

    output: str
    node: int
    text: str


def alarm(stopped: Iterable[StopResult]) -> str:
    """Return what a person must do about axes that may still move; empty where there are none."""
    unsure = [each.axis for each in stopped if not each.ok]
    return f"TREAT {', '.join(unsure)} AS MOVING: use the emergency stop" if unsure else ""


class NodeShutdown(Enum):
    """What is done to a node at the end."""

    REST = "it no longer waits for our heartbeat, and goes to pre-operational"
    AS_FOUND = "it no longer waits for our heartbeat, and keeps its NMT state: its drive was found enabled and is not ours"
    ARMED = "nothing: nobody knows that it stands, and its watch over our heartbeat is left to stop it"


class CellConnection(Protocol[Booted, Parts, Incident, Event]):
    """An opened connection to the nodes of a cell, which are known by their node IDs."""

    @property
    def in_threads(self) -> bool:
        """Whether several nodes may be booted at a time, each in a thread."""

    def boot(self, node_id: int) -> Booted:
        """Bring a node up and configure it, and return what that came to, an error included; blocks."""

    def begin(self) -> None:
        """Make the cycle, over the nodes that have come up."""

    @property
    def cycle(self) -> BusCycle:
        """What paces the scan and carries its frames; there after ``begin``."""

    def ports(self, node_id: int) -> Mapping[str, Port]:
        """Return the ports of a node's axes, by name; none where it has not come up."""

    def io(self, node_id: int) -> IoPort | None:
        """Return the inputs and outputs of a node; None where the cell names none of it, or it is left as it is."""

    def parts(self, node_id: int) -> Parts:
        """Return what direct access to a node is made of; it is there even where the node has not come up."""

    def answers(self, node_id: int) -> bool:
        """Whether a node answers now; blocks for one request."""

    def ready(self) -> None:
        """Block until the scan may do its first cycle, such as for the SYNC of another device; raises what ``BusCycle`` raises."""

    def rescue(self, names: Collection[str]) -> list[StopResult]:
        """Stop the axes of these names without the scan, and return how each was left; blocks."""

    def make_safe(self, points: Collection[IoPoint]) -> list[Unsafe]:
        """Lead outputs to their safe states without the scan, and return those of which that is not confirmed; blocks."""

    def leave(self, how: Mapping[int, NodeShutdown]) -> None:
        """Leave each node as ``how`` says; blocks. A node that is gone is passed over."""

    def close(self) -> None:
        """Release everything."""

    def bus_time(self, now: float) -> datetime | None:
        """Return what another device's TIME says at ``now`` (monotonic seconds), None where none was heard."""

    def incidents(self) -> Sequence[Incident]:
        """Return what the adapter has told of the bus, oldest first."""

    def other_masters(self) -> Sequence[Event]:
        """Return what was heard of another master since ``begin``, oldest first."""

    def on_command_of_others(self, call: Callable[[SecondMasterError, frozenset[int]], None]) -> None:
        """Have ``call`` called, in any thread, with the nodes that another master commands, and the error that says so."""

    def drops(self) -> Sequence[Drop]:
        """Return which frames were dropped."""

    def sdo_counts(self) -> Sequence[SdoCount]:
        """Return how SDO transfers ended, by node; none where there are no frames."""

    def carried(self) -> BusTraffic | None:
        """Return what the bus has carried so far; None where there are no frames."""

    def tap(self, ear: Callable[[CanFrame], None]) -> None:
        """Have ``ear`` called with every frame, in either direction; it must not block. Never called where there are no frames."""

    def untap(self, ear: Callable[[CanFrame], None]) -> None:
        """End that; harmless where it has ended."""
