"""Errors and warnings as events of OPC UA, emitted by the server and by the cell's node Incidents."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from asyncua import Node, Server, ua

from axisbus.gateway.opcua.event_mapping import OpcuaEvent

TYPE = "AxisbusIncidentType"
_FIELDS = ("Cause", "Remedy", "Axis")


class OpcuaEventSender:
    """Send events; holds a generator for each emitting node."""

    def __init__(self) -> None:
        self._generators: list[Any] = []

    async def build(self, server: Server, index: int, source: Node) -> None:
        """Create the type of the events, a subtype of BaseEventType with one text each for cause, remedy and axis."""
        base = server.get_node(ua.NodeId(ua.ObjectIds.BaseEventType))
        kind = await base.add_object_type(ua.NodeId(TYPE, index), ua.QualifiedName(TYPE, index))
        for name in _FIELDS:
            node_id = ua.NodeId(f"{TYPE}/{name}", index)
            await kind.add_property(node_id, ua.QualifiedName(name, index), "", ua.VariantType.String)
        for emitting in (server.get_node(ua.NodeId(ua.ObjectIds.Server)), source):
            generator = await server.get_event_generator(kind, emitting.nodeid)
            generator.event.SourceNode = source.nodeid
            generator.event.SourceName = (await source.read_browse_name()).Name
            self._generators.append(generator)

    async def send(self, timed: Sequence[tuple[OpcuaEvent, datetime]]) -> None:
        """Send each event with the time at which it happened."""
        for told, when in timed:
            for generator in self._generators:
                await _trigger(generator, told, when)


async def _trigger(generator: Any, told: OpcuaEvent, when: datetime) -> None:
    event = generator.event
    event.Severity = told.severity
    event.Cause, event.Remedy, event.Axis = told.cause, told.remedy, told.axis
    await generator.trigger(when, told.message)
