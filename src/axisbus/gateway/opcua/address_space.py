"""The nodes of the server: Machines, the cell with its identification, its axes, variables and methods; all read-only."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from datetime import UTC, datetime

from asyncua import Node, Server, ua

from axisbus.cell.model import AxisConfig, CellConfig
from axisbus.gateway.opcua.axis_readings import Key
from axisbus.gateway.opcua.methods import OpcuaMethod
from axisbus.gateway.opcua.variables import (
    AXIS_TYPE,
    AXIS_TYPES,
    NAMESPACE,
    ROWS,
    OpcuaVariable,
    States,
    Type,
    Unit,
    axis_type,
)
from axisbus.version import __version__

URI = "urn:axisbus:opcua"  # the namespace of all nodes here
TYPES = {
    Type.DOUBLE: ua.VariantType.Double,
    Type.FLOAT: ua.VariantType.Float,
    Type.UINT16: ua.VariantType.UInt16,
}
_WAITING = ua.StatusCode(ua.StatusCodes.BadWaitingForInitialData)
Call = Callable[[OpcuaMethod, str], Awaitable[ua.CallMethodResult]]  # axis name, "" for all


@dataclass(frozen=True, slots=True)
class CellVariables:
    """The variables that are written while the server runs: those of the axes, and those of the cell, by name."""

    values: dict[Key, Node]
    texts: dict[Key, Node]  # nodes for the name of a state, in addition to its number
    running: Node
    devices: Node
    incidents: Node
    machine: Node


class AddressSpaceBuilder:
    """Create the nodes of one cell; holds the index of the namespace."""

    def __init__(self, server: Server, cell: CellConfig, name: str, index: int) -> None:
        """``name``: the name of the cell."""
        self._server, self._cell, self._index = server, cell, index
        self._path = f"Machines/{name}"
        self._name = name
        self._values: dict[Key, Node] = {}
        self._texts: dict[Key, Node] = {}

    async def build(self, verbs: tuple[OpcuaMethod, ...], call: Call) -> CellVariables:
        """Create all nodes; ``verbs`` are the available methods, ``call`` carries them out."""
        machines = await self._server.nodes.objects.add_folder(self._id("Machines"), self._browse("Machines"))
        machine = await self._object(machines, self._path, self._name)
        await self._identification(machine)
        running = await self._variable(
            machine, "Running", False, ua.VariantType.Boolean, "Whether a machine runs."
        )
        devices = await self._variable(
            machine, "Devices", [], ua.VariantType.String, "The identity of each node."
        )
        await devices.write_value_rank(1)
        incidents = await self._object(machine, f"{self._path}/Incidents", "Incidents")
        await self._methods(machine, self._path, verbs, call, "")
        axes = await self._server.get_node(machine).add_folder(
            self._id(f"{self._path}/Axes"), self._browse("Axes")
        )
        for axis in self._cell.axes.values():
            await self._axis(axes, axis, verbs, call)
        return CellVariables(self._values, self._texts, running, devices, incidents, machine)

    # -- parts -------------------------------------------------------------------------------------------------------

    async def _identification(self, machine: Node) -> None:
        path = f"{self._path}/Identification"
        node = await self._object(machine, path, "Identification")
        for name, text in (
            ("ComponentName", self._name),
            ("SoftwareRevision", f"axisbus {__version__}"),
        ):
            await node.add_property(self._id(f"{path}/{name}"), self._browse(name), text)

    async def _axis(self, axes: Node, axis: AxisConfig, verbs: tuple[OpcuaMethod, ...], call: Call) -> None:
        path = f"{self._path}/Axes/{axis.name}"
        node = await self._object(axes, path, axis.name)
        kind = axis_type(axis)
        if kind is not None:
            row = OpcuaVariable(AXIS_TYPE, Type.UINT16, "The motion of the axis.", states=AXIS_TYPES)
            created, text = await self._of_row(node, path, row, axis)
            await self._write(created, ua.Variant(kind, ua.VariantType.UInt16))
            assert text is not None
            await self._write(
                text, ua.Variant(ua.LocalizedText(AXIS_TYPES[kind]), ua.VariantType.LocalizedText)
            )
        for row in ROWS:
            created, text = await self._of_row(node, path, row, axis)
            self._values[axis.name, row.name] = created
            if text is not None:
                self._texts[axis.name, row.name] = text
        await self._methods(node, path, verbs, call, axis.name)

    async def _of_row(
        self, parent: Node, path: str, row: OpcuaVariable, axis: AxisConfig
    ) -> tuple[Node, Node | None]:
        """Create a variable; return it, and the node for the text of its state if the variable is a state."""
        path = f"{path}/{row.name}"
        node = await self._typed(parent, path, row)
        if row.unit is not None:
            await self._property(node, path, "EngineeringUnits", _information(row.unit(axis)))
        if row.states is None:
            return node, None
        await self._property(node, path, "EnumValues", _enumeration(row.states))
        return node, await self._property(node, path, "ValueAsText", ua.LocalizedText(""))

    async def _typed(self, parent: Node, path: str, row: OpcuaVariable) -> Node:
        """Create a variable of its own type that has no value yet; asyncua's function would give all variables one type."""
        kind = ua.ObjectIds.MultiStateValueDiscreteType if row.states else ua.ObjectIds.BaseAnalogType
        attributes = ua.VariableAttributes(
            DisplayName=ua.LocalizedText(row.name),
            Description=ua.LocalizedText(row.words),
            DataType=ua.NodeId(getattr(ua.ObjectIds, row.type.value)),
            ValueRank=ua.ValueRank.Scalar,
            Value=ua.Variant(0, TYPES[row.type]),
            AccessLevel=ua.AccessLevel.CurrentRead.mask,
            UserAccessLevel=ua.AccessLevel.CurrentRead.mask,
        )
        item = ua.AddNodesItem(
            ParentNodeId=parent.nodeid,
            ReferenceTypeId=ua.NodeId(ua.ObjectIds.HasComponent),
            RequestedNewNodeId=self._id(path),
            BrowseName=self._browse(row.name),
            NodeClass=ua.NodeClass.Variable,
            NodeAttributes=attributes,
            TypeDefinition=ua.NodeId(kind),
        )
        created = await self._server.iserver.isession.add_nodes([item])
        created[0].StatusCode.check()
        node = self._server.get_node(created[0].AddedNodeId)
        await self._server.write_attribute_value(node.nodeid, ua.DataValue(StatusCode=_WAITING))
        return node

    async def _methods(
        self, parent: Node, path: str, verbs: tuple[OpcuaMethod, ...], call: Call, axis: str
    ) -> None:
        result = ua.Argument(Name="Result", DataType=ua.NodeId(ua.ObjectIds.String), ValueRank=-1)
        for verb in verbs:
            method = await parent.add_method(
                self._id(f"{path}/{verb.value}"),
                self._browse(verb.value),
                _calling(call, verb, axis, parent.nodeid),
                [],
                [result],
            )
            words = ua.LocalizedText(verb.words)
            await method.write_attribute(ua.AttributeIds.Description, ua.DataValue(words))

    # -- nodes -------------------------------------------------------------------------------------------------------

    def _id(self, path: str) -> ua.NodeId:
        return ua.NodeId(path, self._index)

    def _browse(self, name: str) -> ua.QualifiedName:
        return ua.QualifiedName(name, self._index)

    async def _object(self, parent: Node, path: str, name: str) -> Node:
        return await parent.add_object(self._id(path), self._browse(name))

    async def _variable(
        self, parent: Node, name: str, value: object, variant: ua.VariantType, words: str
    ) -> Node:
        node = await parent.add_variable(self._id(f"{self._path}/{name}"), self._browse(name), value, variant)
        await node.write_attribute(ua.AttributeIds.Description, ua.DataValue(ua.LocalizedText(words)))
        return node

    async def _property(self, node: Node, path: str, name: str, value: object) -> Node:
        return await node.add_property(self._id(f"{path}/{name}"), ua.QualifiedName(name, 0), value)

    async def _write(self, node: Node, variant: ua.Variant) -> None:
        value = ua.DataValue(variant, SourceTimestamp=datetime.now(UTC))
        await self._server.write_attribute_value(node.nodeid, value)


def _calling(
    call: Call, verb: OpcuaMethod, axis: str, parent: ua.NodeId
) -> Callable[..., Awaitable[ua.CallMethodResult]]:
    async def called(object_id: ua.NodeId, *given: object) -> ua.CallMethodResult:
        if object_id != parent:  # the method of another object: this one must not be executed for it
            return ua.CallMethodResult(StatusCode=ua.StatusCode(ua.StatusCodes.BadMethodInvalid))
        if given:
            return ua.CallMethodResult(StatusCode=ua.StatusCode(ua.StatusCodes.BadTooManyArguments))
        return await call(verb, axis)

    return called


def _information(unit: Unit) -> ua.EUInformation:
    return ua.EUInformation(
        NamespaceUri=NAMESPACE,
        UnitId=unit.number,
        DisplayName=ua.LocalizedText(unit.symbol),
        Description=ua.LocalizedText(unit.name),
    )


def _enumeration(states: States) -> list[ua.EnumValueType]:
    return [
        ua.EnumValueType(Value=number, DisplayName=ua.LocalizedText(name)) for number, name in states.items()
    ]
