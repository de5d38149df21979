"""The modules of a cell on a channel of CANopen nodes: what ``core.canlink`` has of them beside its nodes."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from axisbus.boot.can_simple.discovery import BootChannel
from axisbus.boot.can_simple.module import ModuleBoot
from axisbus.boot.result import Booted
from axisbus.bus.node.events import NodeEvents
from axisbus.cell.can_simple.modules import modules_of, settings_of
from axisbus.cell.model import CellConfig
from axisbus.cia402.port import Port
from axisbus.core.can_simple.module_port import ModuleFrameSource, ModuleSender
from axisbus.core.can_simple.node import NoObjects
from axisbus.core.node_access_parts import NodeParts
from axisbus.drives.gim6010.can_simple.port.synthetic_eds import description


class ModuleChannel(BootChannel, ModuleFrameSource, Protocol):
    """What leads to the modules, from their boot on: a ``bus.link.channel.Channel``, or what stands for it in virtual time."""


class CanSimpleModules:
    """Holds the sender of each module, from the opening of the bus on, and what booting it has come to."""

    def __init__(
        self,
        cell: CellConfig,
        channel: ModuleChannel,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Begin to hear them; nothing is sent. ``clock`` and ``sleep`` are those of the channel's stamps, in s."""
        self._cell = cell
        self._channel = channel
        self._clock = clock
        self._sleep = sleep
        self._senders = {
            node_id: ModuleSender(channel, settings_of(cell, node_id)) for node_id in modules_of(cell)
        }
        self._booted: dict[int, Booted] = {}
        self._events: dict[int, NodeEvents] = {}

    def __contains__(self, node_id: int) -> bool:
        return node_id in self._senders

    def boot(self, node_id: int, find_time: float) -> Booted:
        """As ``CellConnection.boot``; ``find_time`` (s) is for the first heartbeat. Before the scan begins."""
        sender = self._senders[node_id]
        port = sender.port
        booted = ModuleBoot(
            self._cell,
            port.settings,
            port.objects,
            self._channel,
            find_time,
            clock=self._clock,
            sleep=self._sleep,
        ).run()
        self._booted[node_id] = booted
        return booted

    def begin(self) -> None:
        """The scan is about to begin: what was heard meanwhile is taken, so that nobody counts as unknown, or as lost."""
        for sender in self.senders:
            sender.prime()
            self._events[sender.node_id] = NodeEvents(sender.node.nmt)

    @property
    def senders(self) -> list[ModuleSender]:
        """Those that have come up, for the cycle."""
        return [self._senders[node_id] for node_id, booted in self._booted.items() if booted.report.ok]

    @property
    def events(self) -> list[NodeEvents]:
        """What is told of them; there after ``begin``."""
        return list(self._events.values())

    def ports(self, node_id: int) -> dict[str, Port]:
        """As ``CellConnection.ports``."""
        return dict.fromkeys(self._booted[node_id].parameters, self._senders[node_id])

    def parts(self, node_id: int) -> NodeParts:
        """As ``CellConnection.parts``."""
        sender = self._senders[node_id]
        return NodeParts(
            node_id,
            description(sender.port.settings),
            NoObjects(node_id),
            sender.node,
            events=self._events.get(node_id),
            clock=self._clock,
            has_objects=False,
        )

    def close(self) -> None:
        """Stop hearing them."""
        for sender in self._senders.values():
            sender.close()
