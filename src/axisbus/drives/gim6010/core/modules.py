"""The CAN Simple modules of a cell on a channel with CANopen nodes, for ``core.canlink``."""

from __future__ import annotations

from typing import Protocol

from axisbus.boot.report import Booted
from axisbus.bus.node.events import NodeEvents
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import objects_refused
from axisbus.cia402.port import Port
from axisbus.core.node_access_parts import NodeParts
from axisbus.drives.gim6010.boot.discovery import BootChannel
from axisbus.drives.gim6010.boot.module import ModuleBoot
from axisbus.drives.gim6010.can_simple.port.synthetic_eds import description
from axisbus.drives.gim6010.cell.modules import modules_of, settings_of
from axisbus.drives.gim6010.core.module_port import ModuleFrameSource, ModuleSender, NoObjects
from axisbus.drives.registry import make_of


class ModuleChannel(BootChannel, ModuleFrameSource, Protocol):
    """The channel of the modules, from their boot on: a ``bus.link.channel.Channel``."""


class CanSimpleModules:
    """Holds the sender of each module, from the opening of the bus on, and its boot result."""

    def __init__(
        self,
        cell: CellConfig,
        channel: ModuleChannel,
    ) -> None:
        """Begin to listen; nothing is sent."""
        self._cell = cell
        self._channel = channel
        self._senders = {
            node_id: ModuleSender(channel, settings_of(cell, node_id)) for node_id in modules_of(cell)
        }
        self._booted: dict[int, Booted] = {}
        self._events: dict[int, NodeEvents] = {}

    def __contains__(self, node_id: int) -> bool:
        return node_id in self._senders

    def boot(self, node_id: int, find_time: float) -> Booted:
        """As ``CellConnection.boot``, before the scan begins; ``find_time`` (s) is the limit for the first heartbeat."""
        sender = self._senders[node_id]
        port = sender.port
        boot = ModuleBoot(
            self._cell,
            port.settings,
            port.objects,
            self._channel,
            find_time,
        )
        booted = boot.run()
        port.feed_within(boot.feed_within)
        self._booted[node_id] = booted
        return booted

    def begin(self) -> None:
        """Process the frames received so far before the scan begins, so that no module counts as unknown, or as lost."""
        for sender in self.senders:
            sender.prime()
            self._events[sender.node_id] = NodeEvents(sender.node.nmt)

    @property
    def senders(self) -> list[ModuleSender]:
        """The booted modules, for the cycle."""
        return [self._senders[node_id] for node_id, booted in self._booted.items() if booted.report.ok]

    @property
    def events(self) -> list[NodeEvents]:
        """Their events; available after ``begin``."""
        return list(self._events.values())

    def ports(self, node_id: int) -> dict[str, Port]:
        """As ``CellConnection.ports``."""
        return dict.fromkeys(self._booted[node_id].parameters, self._senders[node_id])

    def parts(self, node_id: int) -> NodeParts:
        """As ``CellConnection.parts``."""
        sender = self._senders[node_id]
        eds = description(sender.port.settings)
        return NodeParts(
            node_id,
            eds,
            NoObjects(node_id),
            sender.node,
            self._channel.clock,
            events=self._events.get(node_id),
            objects_refused=objects_refused(self._cell, node_id),
            make=make_of(eds),
        )

    def close(self) -> None:
        """Stop listening."""
        for sender in self._senders.values():
            sender.close()
