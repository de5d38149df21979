"""A cell on a CAN bus: the channel, its nodes, their PDOs and ports; with ``interface = "sim"`` also the stand-ins."""

from __future__ import annotations

import itertools
import math
import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import partial

from axisbus.bus.channel import Channel
from axisbus.bus.cycle import CanCycle
from axisbus.bus.nmt import guarding_answer
from axisbus.bus.node import Node
from axisbus.bus.nodeevents import NodeEvents
from axisbus.bus.pdo import configure, set_pdo
from axisbus.bus.plan import Policy, Wanted, spare_cob_ids
from axisbus.bus.port import CanPort
from axisbus.bus.rpdo import CONTROLWORD
from axisbus.cia301 import cob
from axisbus.cia301.bootplan import DEADLINE
from axisbus.cia301.nmt import RESULT, NmtCommand, NmtState
from axisbus.cia301.pdo import MappedObject
from axisbus.cia402.port import Capabilities, Port
from axisbus.eds.model import Eds
from axisbus.errors import BusError, NodeTimeout
from axisbus.machine.boot import Booted, NodeBoot
from axisbus.machine.cell import AxisConfig, CellConfig
from axisbus.machine.configure import HEARTBEATS
from axisbus.machine.node import NodeAccess
from axisbus.machine.node_stop import NodeStop
from axisbus.machine.parting import Parting, Stopped, in_parallel
from axisbus.machine.pickup import Late
from axisbus.machine.runtime import Runtime
from axisbus.machine.standin import StandIn
from axisbus.sim.build import device_from_eds
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

    # -- what boot-up asks for ---------------------------------------------------------------------------------------

    @property
    def find_tries(self) -> int:
        """As many as fit into ``FIND_TIME``."""
        return max(1, math.ceil(FIND_TIME / DEADLINE - 1e-9) - 1)

    def command(self, command: NmtCommand, deadline: float) -> NmtState:
        """Send an NMT command and wait until it is confirmed; one that asks for the state which it reports is not sent.

        Raises:
            NodeTimeout: it is not.
        """
        monitor = self._node.nmt
        if monitor.assumed or monitor.state is not RESULT[command]:
            self._node.command(command, deadline)
        return monitor.state

    def listen(self, deadline: float) -> NmtState | None:
        """Return the state of the next heartbeat."""
        monitor = self._node.nmt
        return monitor.state if monitor.wait_report(monitor.reports, deadline) else None

    def ask(self, deadline: float) -> NmtState | None:
        """Return its state by node guarding."""
        return guarding_answer(self._node.channel, self._node.nmt, deadline)

    @contextmanager
    def trying(self, tries: int, deadline: float) -> Iterator[None]:
        """Make SDO requests ``tries`` times."""
        sdo = self._node.sdo
        before = sdo.tries, sdo.timeout
        sdo.tries, sdo.timeout = tries, deadline
        try:
            yield
        finally:
            sdo.tries, sdo.timeout = before

    def nobody(self) -> NodeTimeout:
        """Return the error of a node that does not answer, with what is known of it and of the bus."""
        channel = self._node.channel
        health = channel.health() or f"nothing is wrong with the channel {channel.name} itself"
        return NodeTimeout(
            f"node {self._node.node_id} does not answer",
            node=self._node.node_id,
            observed=f"no answer to the SDO request for 1000h within {FIND_TIME:g} s, {self._node.nmt.describe(time.monotonic())}; "
            f"{health}",
            remedy="check its supply, cable and termination, its node ID and bit rate (axisbus scan shows who is there)",
        )

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
        )
        plan = configure(self._node.sdo, Wanted(), policy, axis.drive_axis)
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
            entries = [self._node.sdo.dictionary.resolve(key) for key in table.map or ()]
            mapping = tuple(
                MappedObject(entry.index, entry.subindex, entry.data_type.bits or 0)
                for entry in entries
                if entry.data_type is not None
            )
            set_pdo(
                self._node.sdo,
                table.receive,
                table.number,
                mapping=None if table.map is None else mapping,
                transmission_type=table.transmission,
                event_timer=None if table.event_timer is None else round(table.event_timer * 1000),
                inhibit_time=None if table.inhibit_time is None else round(table.inhibit_time * 10_000),
                cob_id=table.cob_id,
            )

    def watch(self, timeout: float | None) -> None:
        """Expect its heartbeat."""
        self._node.nmt.watch(timeout)

    def guard(self, period: float) -> None:
        """Have the scan ask for its state; answers may stay away three times."""
        self.guarding = period
        if self._node.nmt.watched is None:
            self._node.nmt.guard(HEARTBEATS * period + _FIRST_GUARDING)

    def state(self) -> str:
        """Its NMT state."""
        return self._node.nmt.state.text

    def cyclic_rpdos(self) -> list[int]:
        """The RPDOs that hold a controlword: from the first command on the scan sends them in every cycle."""
        first = [_controlword_pdo(port) for port in self.ports.values()]
        return [number for number in first if number is not None]


def _controlword_pdo(port: CanPort) -> int | None:
    pdos = [pdo for pdo in port.plan.active if pdo.receive and CONTROLWORD in pdo.values]
    return pdos[0].target.number if len(pdos) == 1 else None


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
        events = {node_id: NodeEvents(nodes[node_id].nmt) for node_id, one in booted.items() if one.report.ok}
        cycle = CanCycle(
            channel,
            list(there.values()),
            sync_cob_id=cob.SYNC if cell.bus.sync else None,
            master_id=cell.bus.master_id,
            heartbeat=cell.bus.heartbeat or 0.0,
            guarded={node_id: one.guarding for node_id, one in comms.items() if one.guarding is not None},
            events=list(events.values()),
        )
        access = {
            node_id: _access(nodes[node_id], dictionaries[node_id], comms[node_id], events.get(node_id))
            for node_id in nodes
        }
        late = {
            node_id: Late(
                node_id,
                nodes[node_id].answers_sdo,
                partial(_boot_late, cell, nodes[node_id], dictionaries[node_id], cycle, access),
            )
            for node_id, one in booted.items()
            if one.report.absent
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
            late,
        )
    raise AssertionError("unreachable")  # ExitStack suppresses nothing


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
    devices = [device_from_eds(eds, node_id, seed=node_id) for node_id, eds in dictionaries.items()]
    network = stack.enter_context(StandIns(name, devices))
    stand_ins = {device.node_id: StandIn(device, network.lock) for device in devices}
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


def _boot_late(
    cell: CellConfig, node: Node, eds: Eds, cycle: CanCycle, access: dict[int, NodeAccess]
) -> tuple[Booted, Mapping[str, Port]]:
    """Boot an optional node that has appeared while the scan runs, and let the scan's cycle serve it."""
    comms = CanComms(cell, node)
    booted = NodeBoot(cell, node.node_id, eds, node.sdo, comms).run()
    if booted.report.ok:
        events = NodeEvents(node.nmt)
        cycle.add(list(comms.ports.values()), node.node_id, events, comms.guarding)
        access[node.node_id] = _access(node, eds, comms, events)
    return booted, dict[str, Port](comms.ports)


def _access(node: Node, eds: Eds, comms: CanComms, events: NodeEvents | None) -> NodeAccess:
    plans = tuple(port.plan for port in comms.ports.values())
    access = NodeAccess(node.node_id, eds, node.sdo, node, plans, events)
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
