"""All named inputs and outputs of a scan: read and written in each cycle, set by commands, and set to their safe state."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from itertools import groupby
from typing import TYPE_CHECKING

from axisbus.boot.objects import NodeObjects
from axisbus.bus.parallel import in_parallel
from axisbus.cell.io_signals import points_of
from axisbus.cell.model import CellConfig
from axisbus.cia401.port import IoPort
from axisbus.cia401.signal import Address, IoPoint
from axisbus.cia402.port import ValueTransport
from axisbus.clock import Clock
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError, NodeError, SdoTimeout, StateError, Stopped, one_line
from axisbus.link import Unsafe
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.io import IoReading, NodeIo, SetOutputs

if TYPE_CHECKING:
    from axisbus.core.runtime import CellLink


class IoScan:
    """Holds each node's ``NodeIo`` with its port, and the readings of the last cycle. Belongs to the scan's thread."""

    def __init__(self) -> None:
        self.readings: dict[str, IoReading] = {}
        self._nodes: tuple[tuple[IoPort, NodeIo], ...] = ()
        self._node_of: dict[str, NodeIo] = {}
        self._leaving = False
        self.changed = False  # whether a command has ended in this cycle
        self.note: Callable[[Mapping[str, IoReading]], None] = lambda _: None  # called before sending

    def __bool__(self) -> bool:
        return bool(self._nodes)

    def add(self, node: NodeIo, port: IoPort) -> None:
        """Add a node, in place of itself if it was there before: it was booted again. Before the scan begins, or in its thread."""
        for _, earlier in self._nodes:
            if earlier.node_id == node.node_id:
                node.replace(earlier)
        self._node_of = {**self._node_of, **dict.fromkeys(node.points, node)}
        others = (each for each in self._nodes if each[1].node_id != node.node_id)
        self._nodes = (*others, (port, node))

    def width_of(self, name: str) -> int:
        """Return the number of bits of a present point."""
        return self._node_of[name].points[name].width

    def source_of(self, name: str) -> ValueTransport:
        """Return how an input is transported; for an absent one, as a PDO on change."""
        for port, node in self._nodes:
            if name in node.points:
                return port.sources[port.inputs.index(node.points[name].address)]
        return ValueTransport.EVENT_PDO

    def accept(self, command: SetOutputs, ticket: CommandStatus) -> None:
        """Set outputs, all or none; the ticket ends when all act (``NodeIo``), or at once if one cannot be set."""
        if self._leaving:  # it was queued while the axes were stopped
            ticket.finish(Status.ERROR, _closing_error(ticket.name))
            return
        values = dict(command.values)
        by_node: dict[NodeIo, dict[str, int]] = {}
        for name, raw in values.items():
            node = self._node_of.get(name)
            refused = _absent_output(name, ticket.name) if node is None else node.refusal(name, ticket.name)
            if node is None or refused is not None:
                ticket.finish(Status.ERROR, refused)
                return
            by_node.setdefault(node, {})[name] = raw
        ticket.begin()
        shared = _SharedTicket(ticket, len(by_node))
        for node, own in by_node.items():
            node.set(own, shared.part())

    def step(self, now: float) -> None:
        """Read and write, once per cycle, after the axes, whose frames are sent first; sends nothing itself.

        The values are noted before they are sent: if this core dies, its watchdog process makes the noted outputs safe.
        """
        self.changed = False
        readings: dict[str, IoReading] = {}
        for port, node in self._nodes:
            inputs = port.read(now)
            port.write(node.step(now, inputs))
            readings.update(node.readings(now, inputs))
            self.changed = self.changed or node.changed
        self.readings = readings
        self.note(readings)

    def leave(self) -> None:
        """Set all outputs that were set to their safe state, once: when the axes are at standstill, or never will be."""
        if not self._leaving:
            self._leaving = True
            for _, node in self._nodes:
                node.make_safe()

    @property
    def outputs_left(self) -> bool:
        """Whether that has been sent, as far as possible."""
        return self._leaving and all(node.is_idle for _, node in self._nodes)

    @property
    def ours(self) -> list[IoPoint]:
        """The outputs that were set."""
        return [point for _, node in self._nodes for point in node.ours]

    def abandon(self, error: AxisbusError) -> None:
        """End every command: there will be no further cycle."""
        for _, node in self._nodes:
            node.abandon(error)


class _SharedTicket:
    """A command for outputs of several nodes: it ends when all parts have ended, or with the first failure."""

    def __init__(self, ticket: CommandStatus, parts: int) -> None:
        self._ticket = ticket
        self._parts_left = parts

    def part(self) -> CommandStatus:
        """Return the ticket of one node's part."""
        return CommandStatus(self._ticket.name, self._part_ended)

    def _part_ended(self, part: CommandStatus) -> None:
        self._parts_left -= 1
        if part.status is not Status.DONE:
            self._ticket.finish(part.status, part.error)
        elif not self._parts_left:
            self._ticket.finish(Status.DONE)


def _absent_output(name: str, what: str) -> AxisbusError:
    return StateError(
        f"{what} was not sent: {name} is not present",
        observed="its node did not boot, or was found with an enabled drive and was left unchanged",
        remedy="read the report of its node; disable a drive that is enabled; then boot the node (axisbus boot CELL --node N; in "
        "a program: machine.node(N).boot())",
    )


def _closing_error(what: str) -> AxisbusError:
    return Stopped(
        f"{what} was not sent",
        observed="every output is being set to its safe state, because the machine is being closed",
    )


# -- Add the inputs and outputs of a node to the scan, and confirm that their outputs are safe when it has ended -------


def add_io(io_scan: IoScan, cell: CellConfig, link: CellLink, node_id: int, eds: Eds) -> None:
    """Add the inputs and outputs of a booted node, if the cell names any."""
    port = link.io(node_id)
    if port is not None:
        points = points_of(cell, node_id, Dictionary(eds, node_id))
        io_scan.add(NodeIo(node_id, points, port), port)


def confirm_safe_outputs(io_scan: IoScan, link: CellLink) -> list[Unsafe]:
    """Confirm or set the safe state of every output that was set; return those that are not confirmed. Blocks.

    That the scan has sent the safe value is no proof: a node may be lost for a moment before the loss is detected.
    """
    ours = io_scan.ours
    return link.make_safe(ours) if ours else []


def unconfirmed(io_scan: IoScan) -> list[Unsafe]:
    """Return the outputs that were set, before any of them has been checked."""
    text = "closing was aborted before the output was checked"
    return [Unsafe(point.name, point.node, f"{point.object_text}: {text}") for point in io_scan.ours]


def not_safe(unsafe: Unsafe) -> NodeError:
    """Return the error of closing for an output that is not confirmed to be safe."""
    return NodeError(
        f"{unsafe.output} could not be confirmed as safe",
        node=unsafe.node,
        observed=unsafe.text,
        remedy="CHECK IT before a person approaches it; the module still monitors this master's heartbeat, and may have "
        "switched the output itself",
    )


# ----------------------------------------------------------------------------------------------------------------------
# Set outputs to their safe states without the scan, by SDO: SDO works even if PDOs do not, and the result is read back.
#
# An output is changed within the present value of its object, so that other bits stay as they are.


def make_safe(clock: Clock, objects: Mapping[int, NodeObjects], points: Collection[IoPoint]) -> list[Unsafe]:
    """Set ``points`` to their safe states, all nodes at the same time; return those not confirmed. Raises no bus error; blocks."""
    nodes = sorted({point.node for point in points})
    own = [[point for point in points if point.node == node] for node in nodes]
    found = in_parallel(clock, lambda node, mine: _of_node(objects[node], mine), nodes, own)
    return [unsafe for each in found for unsafe in each]


def _of_node(objects: NodeObjects, points: list[IoPoint]) -> list[Unsafe]:
    """Set one object after the other; when the node does not answer, skip the rest."""
    ordered, found = sorted(points, key=_address), list[Unsafe]()
    for address, mine in groupby(ordered, _address):
        try:
            found += _of_object(objects, address, list(mine))
        except SdoTimeout as error:
            rest = ordered[next(at for at, point in enumerate(ordered) if point.address == address) :]
            return [*found, *(_unsafe(point, one_line(error)) for point in rest)]
    return found


def _address(point: IoPoint) -> Address:
    return point.address


def _of_object(objects: NodeObjects, address: Address, points: list[IoPoint]) -> list[Unsafe]:
    try:
        before = _read(objects, address)
        wanted = _with_safe_bits(points, before)
        if before == wanted:
            return []
        objects.write_unchecked(*address, wanted)
        after = _read(objects, address)
    except SdoTimeout:
        raise
    except AxisbusError as error:
        return [_unsafe(point, one_line(error)) for point in points]
    return [
        _unsafe(point, f"{point.safe} was written, and {point.of(after)} was read back")
        for point in points
        if point.of(after) != point.safe
    ]


def _with_safe_bits(points: Iterable[IoPoint], word: int) -> int:
    for point in points:
        word = point.into(word, point.safe)
    return word


def _read(objects: NodeObjects, address: Address) -> int:
    value = objects.read(*address)
    assert isinstance(value, int)
    return int(value)


def _unsafe(point: IoPoint, text: str) -> Unsafe:
    return Unsafe(point.name, point.node, f"{point.object_text} of node {point.node}: {text}")
