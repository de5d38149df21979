"""All named inputs and outputs of a scan: read and written in each cycle, set by commands, and set to their safe state."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from axisbus.cia401.port import IoPort
from axisbus.cia401.signal import IoPoint
from axisbus.cia402.port import ValueTransport
from axisbus.errors import AxisbusError, StateError, Stopped
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.io.commands import SetOutputs
from axisbus.motion.io.node import NodeIo
from axisbus.motion.io.reading import IoReading


class IoScan:
    """Holds each node's ``NodeIo`` with its port, and the readings of the last cycle. Belongs to the scan's thread."""

    def __init__(self) -> None:
        self.readings: dict[str, IoReading] = {}
        self._nodes: tuple[tuple[IoPort, NodeIo], ...] = ()
        self._of: dict[str, NodeIo] = {}
        self._leaving = False
        self.changed = False  # whether a command has ended in this cycle
        self.note: Callable[[Mapping[str, IoReading]], None] = lambda _: None  # called before sending

    def __bool__(self) -> bool:
        return bool(self._nodes)

    def add(self, node: NodeIo, port: IoPort) -> None:
        """Add a node; may be called from any thread."""
        self._of = {**self._of, **dict.fromkeys(node.points, node)}
        self._nodes = (*self._nodes, (port, node))

    def width_of(self, name: str) -> int:
        """Return the number of bits of a present point."""
        return self._of[name].points[name].width

    def source_of(self, name: str) -> ValueTransport:
        """Return how an input is transported; for an absent one, as a PDO on change."""
        for port, node in self._nodes:
            if name in node.points:
                return port.sources[port.inputs.index(node.points[name].address)]
        return ValueTransport.EVENT_PDO

    def accept(self, command: SetOutputs, ticket: CommandStatus) -> None:
        """Set outputs, all or none; the ticket ends when all act (``NodeIo``), or at once if one cannot be set."""
        if self._leaving:  # it was queued while the axes were stopped
            ticket.finish(Status.ERROR, _too_late(ticket.name))
            return
        values = dict(command.values)
        by_node: dict[NodeIo, dict[str, int]] = {}
        for name, raw in values.items():
            node = self._of.get(name)
            refused = _not_there(name, ticket.name) if node is None else node.refusal(name, ticket.name)
            if node is None or refused is not None:
                ticket.finish(Status.ERROR, refused)
                return
            by_node.setdefault(node, {})[name] = raw
        ticket.begin()
        shared = _Shared(ticket, len(by_node))
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
    def left(self) -> bool:
        """Whether that has been sent, as far as possible."""
        return self._leaving and all(node.rests for _, node in self._nodes)

    @property
    def ours(self) -> list[IoPoint]:
        """The outputs that were set."""
        return [point for _, node in self._nodes for point in node.ours]

    def abandon(self, error: AxisbusError) -> None:
        """End every command: there will be no further cycle."""
        for _, node in self._nodes:
            node.abandon(error)


class _Shared:
    """A command for outputs of several nodes: it ends when all parts have ended, or with the first failure."""

    def __init__(self, ticket: CommandStatus, parts: int) -> None:
        self._ticket = ticket
        self._left = parts

    def part(self) -> CommandStatus:
        """Return the ticket of one node's part."""
        return CommandStatus(self._ticket.name, self._hear)

    def _hear(self, part: CommandStatus) -> None:
        self._left -= 1
        if part.status is not Status.DONE:
            self._ticket.finish(part.status, part.error)
        elif not self._left:
            self._ticket.finish(Status.DONE)


def _not_there(name: str, what: str) -> AxisbusError:
    return StateError(
        f"{what} was not sent: {name} is not present",
        observed="its node did not boot, or was found with an enabled drive and was left unchanged",
        remedy="read the report of its node; switch the drive off and open the machine again",
    )


def _too_late(what: str) -> AxisbusError:
    return Stopped(
        f"{what} was not sent",
        observed="every output is being set to its safe state, because the machine is being closed",
    )
