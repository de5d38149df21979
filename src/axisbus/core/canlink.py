"""The link over a CAN bus: the channel, its nodes, their boot-up and ports; with ``interface = "sim"`` also simulated drives."""

from __future__ import annotations

import itertools
import logging
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack, nullcontext, suppress
from datetime import datetime
from functools import partial

from axisbus.boot.comms import CanComms
from axisbus.boot.node import NodeBoot
from axisbus.boot.report import Booted
from axisbus.bus.cycle import BootHeartbeat, CanCycle
from axisbus.bus.io_port import CanIoPort
from axisbus.bus.link import ownership
from axisbus.bus.link.channel import Channel
from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.link.detect_other_master import require_no_other_master
from axisbus.bus.node.events import NodeEvent, NodeEvents
from axisbus.bus.node.master_watch import Echoes, MasterWatch, OnCommand
from axisbus.bus.node.nmt import send
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.parallel import in_parallel
from axisbus.bus.pdo.cob_id_conflicts import CobIdUses
from axisbus.bus.port import CanPort
from axisbus.bus.sync_and_time import SyncConsumer, TimeConsumer, TimeProducer
from axisbus.cell.model import SIMULATED, BusConfig, CellConfig
from axisbus.cia301.dropped_frames import Drop
from axisbus.cia301.frame import BusTraffic, CanFrame
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia301.sdo_counts import SdoCount
from axisbus.cia302.types import Address
from axisbus.cia401.port import IoPort
from axisbus.cia401.signal import IoPoint
from axisbus.cia402.port import Port
from axisbus.clock import VirtualClock
from axisbus.core.io import make_safe
from axisbus.core.master_detection import expected_masters_of, listening_time
from axisbus.core.node_access_parts import NodeParts
from axisbus.core.other_protocols import (
    AllOtherNodes,
    accesses_of,
    foreign_nodes_of,
    simulated_foreign_nodes,
    stop_drives,
)
from axisbus.core.process.bus_factory import open_bus
from axisbus.core.realtime_setup import SPIN
from axisbus.core.simulated_nodes import SimulatedNode, devices
from axisbus.drives.registry import make_of
from axisbus.eds.model import Eds
from axisbus.errors import BusError, BusOff, Interrupted, StateError
from axisbus.link import NodeShutdown, StopResult, Unsafe
from axisbus.sim.device import Device
from axisbus.sim.node.network import SimulatedNetwork
from axisbus.sim.virtual_can import BITRATE, VirtualSyncProducer, VirtualWire

log = logging.getLogger("axisbus")
FIND_TIME = 3.0  # seconds for the first answer of a node
_CHANNELS = itertools.count(1)
OnProgram = Callable[[int, int, int | None], None]


class CanLink:
    """A ``CellConnection`` over a CAN bus with CANopen nodes and nodes of other protocols; holds channel and boot results."""

    def __init__(
        self,
        cell: CellConfig,
        dictionaries: Mapping[int, Eds],
        on_program: OnProgram | None = None,
        channel: Channel | None = None,
        simulated_nodes: Mapping[int, SimulatedNode] | None = None,
        wire: VirtualWire | None = None,
    ) -> None:
        """Open the bus; if another master is heard on it, nothing is sent.

        ``channel``: an open connection to simulated drives; ``simulated_nodes`` and ``wire``: as from ``simulated_channel``.
        ``on_program`` is called in the thread that boots a node, with its ID and the received and the total bytes of its program.

        Raises:
            AdapterError: the channel cannot be opened.
            SecondMasterError: another master is heard.
        """
        self._cell = cell
        self._dictionaries = dictionaries
        self._on_program = on_program
        self._comms: dict[int, CanComms] = {}
        self._cob_ids = CobIdUses(dictionaries)
        self._booted: dict[int, Booted] = {}
        self._parts: dict[int, NodeParts] = {}
        self._events: dict[int, NodeEvents] = {}  # of each node that has come up
        self._cycle: CanCycle | None = None
        self._consumer: SyncConsumer | None = None
        with ExitStack() as stack:
            self.simulated_nodes = dict(simulated_nodes or {})
            self.wire = wire
            # Only simulated drives are on it.
            self._private = private = channel is not None or cell.bus.interface == SIMULATED
            if channel is None:
                _claim_channel(cell, stack)
                channel, self.simulated_nodes = open_channel(cell, dictionaries, stack)
            else:
                stack.enter_context(channel)
            self._channel = channel
            self.clock = channel.clock
            if not private and not cell.bus.beside:
                require_no_other_master(
                    self._channel, expected_masters_of(cell, dictionaries), listening_time(cell.bus)
                )
            self._watch = MasterWatch(self._channel, stops=not cell.bus.beside)
            stack.callback(self._watch.close)
            self._echoes = Echoes(self._channel)
            stack.callback(self._echoes.end)
            self._nodes = {
                node_id: stack.enter_context(CanopenNode(self._channel, node_id, eds))
                for node_id, eds in dictionaries.items()
            }
            self._others = AllOtherNodes(cell, self._channel)
            stack.callback(self._others.close)
            self._heartbeat = BootHeartbeat(self._channel, cell.bus.master_id, cell.bus.heartbeat or 0.0)
            stack.callback(self._heartbeat.end)
            self._stack = stack.pop_all()

    def boot(
        self,
        node_id: int,
        before: Mapping[Address, int] | None = None,
        on_step: Callable[[str], None] = lambda _: None,
    ) -> Booted:
        """As ``CellConnection.boot``."""
        if node_id in self._others:
            return self._others.of(node_id).boot(node_id, FIND_TIME)
        node, late = self._nodes[node_id], self._cycle is not None
        events = self._events.get(node_id)
        if late:
            node.worker.clear()
            if node.nmt.overdue(self.clock.now()):
                node.nmt.forget_heartbeats()
        comms = CanComms(self._cell, node, FIND_TIME, self._heartbeat.begin, self._cob_ids)
        progress = None if self._on_program is None else partial(self._on_program, node_id)
        booted = NodeBoot(
            self._cell,
            node_id,
            self._dictionaries[node_id],
            node.sdo,
            comms,
            progress,
            late=late,
            again=events is not None,
            before=before,
            on_step=on_step,
        ).run()
        self._booted[node_id] = booted
        if not late:
            self._comms[node_id] = comms
        elif booted.report.ok:
            self._comms[node_id] = comms
            self._events[node_id] = NodeEvents(node.nmt) if events is None else events
            self._parts[node_id] = self._make_parts(node_id)
            self._watch_masters()
        else:
            comms.close()
        return booted

    def admit(self, node_id: int) -> None:
        """As ``CellConnection.admit``."""
        comms = self._comms[node_id]
        self.cycle.add(comms.senders, self._nodes[node_id].nmt, self._events[node_id], comms.guarding)

    def begin(self) -> None:
        """As ``CellConnection.begin``; listens to another device's SYNC and TIME, if the cell configures this."""
        bus = self._cell.bus
        self._events = {
            node_id: NodeEvents(self._nodes[node_id].nmt)
            for node_id, one in self._booted.items()
            if one.report.ok
        }
        self._others.begin()
        self._consumer = _sync_consumer(bus, self._channel)
        self._cycle = CanCycle(
            self._channel,
            [*self._axis_ports(), *self._io_ports(), *self._others.senders],
            sync_cob_id=bus.sync_cob_id if bus.sync and self._consumer is None else None,
            sync_counter=bus.sync_counter,
            sync_consumer=self._consumer,
            time_producer=_time_producer(bus, self._channel),
            master_id=bus.master_id,
            heartbeat=bus.heartbeat or 0.0,
            boot_heartbeat=self._heartbeat,
            guarded={
                self._nodes[node_id].nmt: one.guarding
                for node_id, one in self._comms.items()
                if one.guarding is not None
            },
            events=[*self._events.values(), *self._others.events],
            spin=SPIN if self.clock.realtime else 0.0,
        )
        self._stack.callback(self._cycle.close)
        self._parts = {node_id: self._make_parts(node_id) for node_id in self._nodes}
        self._time = TimeConsumer(self._channel, bus.time_cob_id)
        self._echoes.end()
        self._watch_masters()

    @property
    def cycle(self) -> CanCycle:
        """As ``CellConnection.cycle``."""
        assert self._cycle is not None
        return self._cycle

    def ports(self, node_id: int) -> Mapping[str, Port]:
        """As ``CellConnection.ports``."""
        if node_id in self._others:
            return self._others.of(node_id).ports(node_id)
        return dict[str, Port](self._comms[node_id].ports)

    def io(self, node_id: int) -> IoPort | None:
        """As ``CellConnection.io``."""
        return None if node_id in self._others else self._comms[node_id].io

    def parts(self, node_id: int) -> NodeParts:
        """As ``CellConnection.parts``."""
        return self._others.of(node_id).parts(node_id) if node_id in self._others else self._parts[node_id]

    def answers(self, node_id: int) -> bool:
        """As ``CellConnection.answers``: an SDO upload of 1000h."""
        try:
            return self._nodes[node_id].answers_sdo()
        except Interrupted:
            return False

    def ready(self) -> None:
        """As ``CellConnection.ready``; raises SyncError if another device should send SYNC and does not."""
        if self._consumer is not None:
            self._consumer.await_steady()

    def rescue(self, names: Collection[str]) -> list[StopResult]:
        """As ``CellConnection.rescue``, CANopen nodes by SDO, and all nodes at once; blocks as ``stop_drives``."""
        with self.cycle.keep_stopping():
            return stop_drives(self._cell, self._channel, self._nodes.values(), names)

    def make_safe(self, points: Collection[IoPoint]) -> list[Unsafe]:
        """As ``CellConnection.make_safe``, by SDO."""
        return make_safe(self.clock, {node_id: node.sdo for node_id, node in self._nodes.items()}, points)

    def require_reconnectable(self, scan_failed: bool) -> None:
        """As ``CellConnection.require_reconnectable``."""
        if self._consumer is not None:
            raise StateError(
                "the adapter cannot be opened again while the machine is open: another device sends SYNC",
                remedy="close the machine and open it again",
            )
        if not scan_failed or self._channel.failure is not None:
            self._channel.require_reopenable()

    def reconnect(self, listen: bool = True) -> None:
        """As ``CellConnection.reconnect``."""
        if self._channel.failure is not None or isinstance(self._channel.off, BusOff):
            self._channel.reopen()
        if listen and not self._private and not self._cell.bus.beside:
            try:
                require_no_other_master(
                    self._channel,
                    expected_masters_of(self._cell, self._dictionaries),
                    listening_time(self._cell.bus),
                )
            except BusError as error:
                self._channel.fail(error)
                raise
        for node in self._nodes.values():
            node.worker.clear()
            node.nmt.forget_heartbeats()
        if self.cycle.has_stopped:  # the scan does not run, and the axes may still move
            self.cycle.quick_stop_all()
        in_parallel(self.clock, _wake, list(self._nodes.values()))

    def leave(self, how: Mapping[int, NodeShutdown]) -> None:
        """As ``CellConnection.leave``."""
        in_parallel(  # a module needs no release: it does not monitor the master
            self.clock,
            lambda node_id: _leave_node(self._nodes[node_id], self._booted[node_id], how[node_id]),
            self._booted,
        )

    def close(self) -> None:
        """As ``CellConnection.close``."""
        self._stack.close()

    def bus_time(self, now: float) -> datetime | None:
        """As ``CellConnection.bus_time``."""
        return self._time.at(now)

    def incidents(self) -> Sequence[ControllerEvent]:
        """Return the events of the CAN controller."""
        return tuple(self._channel.controller.events)

    def other_masters(self) -> Sequence[NodeEvent]:
        """As ``CellConnection.other_masters``."""
        return self._watch.events

    def on_command_of_others(self, call: OnCommand) -> None:
        """As ``CellConnection.on_command_of_others``; in the receive thread."""
        self._watch.on_command = call

    def drops(self) -> Sequence[Drop]:
        """As ``CellConnection.drops``."""
        return self._channel.drops.found

    def sdo_counts(self) -> Sequence[SdoCount]:
        """As ``CellConnection.sdo_counts``."""
        return self._channel.sdo_counts.found

    def carried(self) -> BusTraffic:
        """As ``CellConnection.carried``."""
        return self._channel.carried

    def tap(self, handler: Callable[[CanFrame], None]) -> None:
        """As ``CellConnection.tap``."""
        self._channel.tap(handler)

    def untap(self, handler: Callable[[CanFrame], None]) -> None:
        """As ``CellConnection.untap``."""
        self._channel.untap(handler)

    def _watch_masters(self) -> None:
        """Listen for another master from now on, including the COB-IDs of the nodes that have come up."""
        if self._echoes.detected:
            log.warning(
                "%s returns the frames of this program as if another node had sent them: another master on the bus cannot "
                "be detected",
                self._channel.name,
            )
            return
        ports: list[CanPort | CanIoPort] = [*self._axis_ports(), *self._io_ports()]
        rpdos = {
            pdo.target.cob_id: port.node.node_id for port in ports for pdo in port.plan.active if pdo.receive
        }
        self._watch.begin(expected_masters_of(self._cell, self._dictionaries, rpdos))

    def _axis_ports(self) -> list[CanPort]:
        driven = [axis for axis in self._cell.driven.values() if axis.node not in self._others]
        found = [self._comms[axis.node].ports.get(axis.name) for axis in driven]
        return [port for port in found if port is not None]

    def _io_ports(self) -> list[CanIoPort]:
        """Return the ports of inputs and outputs. They follow the axes: no frame may separate a target from its controlword."""
        return [one.io for one in self._comms.values() if one.io is not None]

    def _make_parts(self, node_id: int) -> NodeParts:
        node, ports = self._nodes[node_id], self._comms[node_id].ports.values()
        plans = tuple(port.plan for port in ports)
        io = self._comms[node_id].io
        plans = plans if io is None else (*plans, io.plan)
        eds, events = self._dictionaries[node_id], self._events.get(node_id)
        make = make_of(eds, self._cell.nodes[node_id].makes)
        return NodeParts(node_id, eds, node.sdo, node, self.clock, plans, events, make=make)


def _wake(node: CanopenNode) -> None:
    """Switch a node that does not answer to pre-operational: as the last step of a stop, it may have got NMT *stop*."""
    with suppress(BusError):
        if not node.answers_sdo():
            send(node.channel, NmtCommand.ENTER_PRE_OPERATIONAL, node.node_id)


def _claim_channel(cell: CellConfig, stack: ExitStack) -> None:
    """Claim the channel for this program, unless the parent process has done it; programs cannot join through this lock."""
    bus, simulated = cell.bus, cell.bus.interface == SIMULATED
    lock = ownership.hold(bus.interface, bus.channel, cell.file, beside=bus.beside, simulated=simulated)
    if lock is not None:
        stack.enter_context(lock)


def _sync_consumer(bus: BusConfig, channel: Channel) -> SyncConsumer | None:
    """Listen to another device's SYNC, if the cell configures this."""
    if not bus.hears_sync:
        return None
    return SyncConsumer(channel, bus.sync_cob_id, bus.scan_period, bus.sync_timeout)


def _time_producer(bus: BusConfig, channel: Channel) -> TimeProducer | None:
    return None if bus.time is None else TimeProducer(channel, bus.time, bus.time_cob_id)


def open_channel(
    cell: CellConfig, dictionaries: Mapping[int, Eds], stack: ExitStack
) -> tuple[Channel, dict[int, SimulatedNode]]:
    """Open the bus of a cell, with ``interface = "sim"`` a private one with simulated drives on it; ``stack`` closes it.

    Raises:
        AdapterError: it cannot be opened.
    """
    bus = cell.bus
    if bus.interface != SIMULATED:
        return stack.enter_context(open_bus(cell)), {}
    name = f"axisbus-sim-{os.getpid()}-{next(_CHANNELS)}"
    made, others = devices(cell, dictionaries), simulated_foreign_nodes(cell)
    network = stack.enter_context(
        SimulatedNetwork(name, list(made.values()), foreign_nodes=foreign_nodes_of(others))
    )
    simulated_nodes = {node_id: SimulatedNode(device, network.lock) for node_id, device in made.items()}
    simulated_nodes |= accesses_of(others, network.lock)
    channel = stack.enter_context(Channel.open("virtual", name))
    channel.behind = network.behind
    return channel, simulated_nodes


def simulated_channel(
    cell: CellConfig,
    dictionaries: Mapping[int, Eds],
    clock: VirtualClock,
    given: Mapping[int, Device] | None = None,
) -> tuple[Channel, dict[int, SimulatedNode], VirtualWire]:
    """Return a channel on a simulated wire in the time of ``clock``, with all nodes of a cell, and the user's access to the nodes.

    ``given`` replaces simulated drives, by node-ID. A wire without a bit rate in the cell file has 1 Mbit/s. If another device
    shall send SYNC, and none of the nodes does, it is simulated as well.

    Raises:
        ConfigError: the options of the simulation are wrong.
    """
    made, others = devices(cell, dictionaries) | dict(given or {}), simulated_foreign_nodes(cell)
    wire = VirtualWire(
        clock, list(made.values()), foreign_nodes_of(others), bitrate=cell.bus.bitrate or BITRATE
    )
    bus = cell.bus
    if bus.hears_sync and not wire.has_sync_producer:
        VirtualSyncProducer(wire, clock, bus.sync_cob_id, bus.scan_period, bus.sync_counter)
    simulated_nodes = {node_id: SimulatedNode(device, nullcontext()) for node_id, device in made.items()}
    simulated_nodes |= accesses_of(others, nullcontext())
    channel = Channel(wire.connect(), "virtual time", clock=clock, opener=lambda: (wire.connect(), None))
    return channel, simulated_nodes, wire


def _leave_node(node: CanopenNode, booted: Booted, how: NodeShutdown) -> None:
    """Leave a node before our heartbeat ends: without a fault, or with its monitoring armed to stop an axis that may still move."""
    if how is NodeShutdown.ARMED:
        return
    with suppress(BusError):  # a node that is gone cannot be released
        if booted.watch is not None:
            booted.watch.restore()
        if booted.report.ok and how is NodeShutdown.REST:
            node.command(NmtCommand.ENTER_PRE_OPERATIONAL, timeout=0.5)
