"""A cell on a CAN bus: the channel, its nodes, their PDOs and ports; with ``interface = "sim"`` also the stand-ins."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack, suppress
from functools import partial

from axisbus.bus.channel import Channel
from axisbus.bus.cycle import CanCycle
from axisbus.bus.node import Node
from axisbus.bus.pdo import configure, set_pdo
from axisbus.bus.pdo_read import read_number
from axisbus.bus.plan import Policy, Wanted, spare_cob_ids
from axisbus.bus.port import CanPort
from axisbus.bus.sync import SyncConsumer
from axisbus.bus.timeofday import TimeConsumer, TimeProducer
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia402.port import Capabilities, Port
from axisbus.eds.model import Eds
from axisbus.errors import BusError, NodeTimeout
from axisbus.machine.boot import Booted, NodeBoot
from axisbus.machine.cell import AxisConfig, BusConfig, CellConfig
from axisbus.machine.checks.pdomodel import fixed_pdos, map_entry, requested_pdos
from axisbus.machine.configure import HEARTBEATS
from axisbus.machine.node import NodeAccess
from axisbus.machine.node_stop import NodeStop
from axisbus.machine.parting import Parting, Stopped, in_parallel
from axisbus.machine.runtime import Runtime
from axisbus.machine.simulated import devices
from axisbus.machine.standin import StandIn
from axisbus.sim.network import StandIns

SIM = "sim"
_FIRST_GUARDING = 2.0  # seconds until the scan, which asks, has begun: other nodes may still be booting
FIND_TIME = 3.0  # seconds that a node may take to answer for the first time
_CHANNELS = itertools.count(1)


class CanComms:
    """What boot-up needs of one node on a bus; holds the ports that it made."""

    def __init__(self, cell: CellConfig, node: Node) -> None:
        self._cell = cell
        self._config = cell.nodes[node.node_id]
        self._tables = self._config.pdos
        self._node = node
        self.ports: dict[str, CanPort] = {}
        self.guarding: float | None = None

    def find(self) -> None:
        """Ask until the node answers, for ``FIND_TIME`` seconds.

        Raises:
            NodeTimeout: it does not.
        """
        deadline = time.monotonic() + FIND_TIME
        while not self._node.answers_sdo():
            if time.monotonic() > deadline:
                raise self._nobody()
        self._follow_emcy()

    def _follow_emcy(self) -> None:
        """Listen to the node's emergency messages where its 1014h says that they are, else where the standard has them."""
        value = read_number(self._node.sdo, o.COB_ID_EMCY, 0)
        if value is not None and not value & cob.INVALID and value & cob.ID_MASK_11 not in (0, cob.EMCY):
            self._node.emcy.listen_to(value & cob.ID_MASK_11)

    def prepare(self, disturb: bool) -> None:
        """Bring the node to pre-operational, where that disturbs nothing."""
        if disturb and self._node.nmt.state is not NmtState.PRE_OPERATIONAL:
            self._node.command(NmtCommand.ENTER_PRE_OPERATIONAL)

    def connect(self, axis: AxisConfig, disturb: bool, sync_needed: bool) -> Capabilities:  # noqa: ARG002
        """Plan and set the PDOs of an axis, make its port, and fill it with the drive's present values."""
        if disturb:
            self._set_tables()
        policy = Policy(
            sync=self._cell.bus.sync,
            remap=disturb and self._config.remappable and not self._config.pdos,
            communication=disturb,
            taken=_cob_ids_of(set(self._cell.nodes) - {self._node.node_id}),
            spare=spare_cob_ids(frozenset(self._cell.nodes), self._node.node_id),
            fixed=fixed_pdos(self._config.pdos),
            requests=requested_pdos(self._config.pdos),
        )
        also = [(table.receive, table.number) for table in self._config.pdos]
        plan = configure(self._node.sdo, Wanted(), policy, axis.drive_axis, also=also)
        port = CanPort(
            self._node, plan, scan_period=self._cell.bus.scan_period, remappable=self._config.remappable
        )
        port.prime()
        self.ports[axis.name] = port
        return port.capabilities

    def _set_tables(self) -> None:
        """Set the PDOs of ``[nodes.N.pdo]``; once for all axes of the node."""
        tables, self._tables = self._tables, ()
        for table in tables:
            mapping = tuple(map_entry(key, self._node.sdo.dictionary)[0] for key in table.map or ())
            set_pdo(
                self._node.sdo,
                table.receive,
                table.number,
                mapping=None if table.map is None else mapping,
                transmission_type=table.transmission,
                event_timer=None if table.event_timer is None else round(table.event_timer * 1000),
                inhibit_time=None if table.inhibit_time is None else round(table.inhibit_time * 10_000),
                cob_id=table.cob_id,
                sync_start=table.sync_start,
                rtr=None if table.rtr is None else True,
            )

    def watch(self, timeout: float | None) -> None:
        """Expect its heartbeat."""
        self._node.nmt.watch(timeout)

    def guard(self, period: float) -> None:
        """Have the scan ask for its state; answers may stay away three times."""
        self.guarding = period
        if self._node.nmt.watched is None:
            self._node.nmt.guard(HEARTBEATS * period + _FIRST_GUARDING)

    def start(self) -> str:
        """Start the node and wait until it confirms."""
        if self._node.nmt.state is not NmtState.OPERATIONAL:
            self._node.command(NmtCommand.START)
        return self._node.nmt.state.text

    def _nobody(self) -> NodeTimeout:
        channel = self._node.channel
        health = channel.health() or f"nothing is wrong with the channel {channel.name} itself"
        return NodeTimeout(
            f"node {self._node.node_id} does not answer",
            node=self._node.node_id,
            observed=f"no answer to the SDO request for 1000h within {FIND_TIME:g} s, {self._node.nmt.describe(time.monotonic())}; "
            f"{health}",
            remedy="check its supply, cable and termination, its node ID and bit rate (axisbus scan shows who is there)",
        )


def build_on_bus(
    cell: CellConfig, dictionaries: Mapping[int, Eds], on_report: Callable[[Booted], None] | None = None
) -> Runtime:
    """Open the bus, boot all nodes in parallel, and return the runtime; blocks for as long as that takes.

    Raises:
        AdapterError: the channel cannot be opened, or failed.
    """
    with ExitStack() as stack:
        channel, stand_ins = open_channel(cell, dictionaries, stack)
        nodes = {
            node_id: stack.enter_context(Node(channel, node_id, eds)) for node_id, eds in dictionaries.items()
        }
        comms = {node_id: CanComms(cell, node) for node_id, node in nodes.items()}
        booted = _boot_all(cell, dictionaries, nodes, comms, on_report)
        ports = {name: comms[axis.node].ports.get(name) for name, axis in cell.axes.items()}
        there = {name: port for name, port in ports.items() if port is not None}
        consumer = _sync_consumer(cell.bus, channel)
        cycle = CanCycle(
            channel,
            list(there.values()),
            sync_cob_id=cell.bus.sync_cob_id if cell.bus.sync and consumer is None else None,
            sync_counter=cell.bus.sync_counter,
            sync_consumer=consumer,
            time_producer=_time_producer(cell.bus, channel),
            master_id=cell.bus.master_id,
            heartbeat=cell.bus.heartbeat or 0.0,
            guarded={node_id: one.guarding for node_id, one in comms.items() if one.guarding is not None},
        )
        access = {
            node_id: _access(nodes[node_id], dictionaries[node_id], comms[node_id]) for node_id in nodes
        }
        return Runtime(
            cycle,
            dict[str, Port](there),
            booted,
            access,
            partial(_rescue, cell, nodes),
            partial(_let_all_go, nodes, booted),
            [cycle.close, stack.pop_all().close],
            stand_ins,
            ready=_nothing if consumer is None else consumer.await_steady,
            bus_time=TimeConsumer(channel, cell.bus.time_cob_id).at,
        )
    raise AssertionError("unreachable")  # ExitStack suppresses nothing


def _sync_consumer(bus: BusConfig, channel: Channel) -> SyncConsumer | None:
    """Listen to another device's SYNC where the cell says so."""
    if not bus.hears_sync:
        return None
    return SyncConsumer(channel, bus.sync_cob_id, bus.scan_period, bus.sync_timeout)


def _nothing() -> None:
    """The scan needs nothing but our own clock."""


def _time_producer(bus: BusConfig, channel: Channel) -> TimeProducer | None:
    return None if bus.time is None else TimeProducer(channel, bus.time, bus.time_cob_id)


def open_channel(
    cell: CellConfig, dictionaries: Mapping[int, Eds], stack: ExitStack
) -> tuple[Channel, dict[int, StandIn]]:
    """Open the bus of a cell, with ``interface = "sim"`` a private one with stand-ins on it; ``stack`` closes it.

    Raises:
        AdapterError: it cannot be opened.
    """
    bus = cell.bus
    if bus.interface != SIM:
        return stack.enter_context(Channel.open(bus.interface, bus.channel, bus.bitrate, **bus.options)), {}
    name = f"axisbus-sim-{os.getpid()}-{next(_CHANNELS)}"
    made = devices(cell, dictionaries)
    network = stack.enter_context(StandIns(name, list(made.values())))
    stand_ins = {node_id: StandIn(device, network.lock) for node_id, device in made.items()}
    return stack.enter_context(Channel.open("virtual", name)), stand_ins


def _boot_all(
    cell: CellConfig,
    dictionaries: Mapping[int, Eds],
    nodes: Mapping[int, Node],
    comms: Mapping[int, CanComms],
    on_report: Callable[[Booted], None] | None,
) -> dict[int, Booted]:
    def boot(node_id: int) -> Booted:
        booted = NodeBoot(cell, node_id, dictionaries[node_id], nodes[node_id].sdo, comms[node_id]).run()
        if on_report is not None:
            on_report(booted)
        return booted

    return dict(zip(nodes, in_parallel(boot, nodes), strict=True))


def _access(node: Node, eds: Eds, comms: CanComms) -> NodeAccess:
    plans = tuple(port.plan for port in comms.ports.values())
    access = NodeAccess(node.node_id, eds, node.sdo, node, plans)
    access.sdo.cyclic = frozenset(
        (mapped.index, mapped.subindex)
        for plan in plans
        for pdo in plan.active
        if pdo.receive
        for mapped in pdo.target.mapping
    )
    return access


def _rescue(cell: CellConfig, nodes: Mapping[int, Node], names: Collection[str]) -> list[Stopped]:
    """Stop axes without the scan, by SDO; blocks as ``NodeStop.run``."""
    axes = [[axis for axis in cell.axes_of(node_id) if axis.name in names] for node_id in nodes]
    results = in_parallel(lambda node, own: NodeStop(node, own).run(), nodes.values(), axes)
    return [result for node in results for result in node]


def _let_all_go(nodes: Mapping[int, Node], booted: Mapping[int, Booted], how: Mapping[int, Parting]) -> None:
    in_parallel(lambda node_id: _let_go(nodes[node_id], booted[node_id], how[node_id]), booted)


def _let_go(node: Node, booted: Booted, how: Parting) -> None:
    """Our heartbeat will end now: leave the node so that this faults nobody, or stops whoever may still move."""
    if how is Parting.ARMED:
        return
    with suppress(BusError):  # a node that is gone cannot be let go
        if booted.watch is not None:
            booted.watch.restore()
        if booted.report.ok and how is Parting.REST:
            node.command(NmtCommand.ENTER_PRE_OPERATIONAL, timeout=0.5)


def _cob_ids_of(node_ids: set[int]) -> frozenset[int]:
    return frozenset(base + node_id for node_id in node_ids for base in (*cob.RPDO, *cob.TPDO))
