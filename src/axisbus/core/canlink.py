"""A cell on a CAN bus: the channel, its nodes, their boot-up and their ports; with ``interface = "sim"`` also the stand-ins."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack, suppress
from functools import partial

from axisbus.boot.comms import CanComms
from axisbus.boot.node import Booted, NodeBoot
from axisbus.bus.cycle import CanCycle
from axisbus.bus.link.alone import require_alone
from axisbus.bus.link.channel import Channel
from axisbus.bus.node.events import NodeEvents
from axisbus.bus.node.node import Node
from axisbus.bus.sync import SyncConsumer
from axisbus.bus.timeofday import TimeConsumer, TimeProducer
from axisbus.cell.model import SIMULATED, BusConfig, CellConfig
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia402.port import Port
from axisbus.core.alone import cast_of, listening_time
from axisbus.core.node_access import NodeAccess
from axisbus.core.node_stop import NodeStop
from axisbus.core.parting import Parting, Stopped, in_parallel
from axisbus.core.pickup import Late
from axisbus.core.runtime import Runtime
from axisbus.core.simulated import devices
from axisbus.core.stand_in import StandIn
from axisbus.eds.model import Eds
from axisbus.errors import BusError
from axisbus.sim.node.network import StandIns

FIND_TIME = 3.0  # seconds that a node may take to answer for the first time
_CHANNELS = itertools.count(1)
OnProgram = Callable[[int, int, int | None], None]


def build_on_bus(
    cell: CellConfig,
    dictionaries: Mapping[int, Eds],
    on_report: Callable[[Booted], None] | None = None,
    on_program: OnProgram | None = None,
) -> Runtime:
    """Open the bus, boot all nodes in parallel, and return the runtime; blocks for as long as that takes.

    ``on_report`` is called with each node that is through, ``on_program`` with a node's ID and the bytes of its program that have
    arrived and that there are; both in the threads of the nodes.

    Raises:
        AdapterError: the channel cannot be opened, or failed.
        SecondMasterError: another master is heard on it; then nothing was sent.
    """
    with ExitStack() as stack:
        channel, stand_ins = open_channel(cell, dictionaries, stack)
        if not stand_ins and not cell.bus.beside:  # on a private bus there is nobody but our stand-ins
            require_alone(channel, cast_of(cell, dictionaries), listening_time(cell.bus))
        nodes = {
            node_id: stack.enter_context(Node(channel, node_id, eds)) for node_id, eds in dictionaries.items()
        }
        comms = {node_id: CanComms(cell, node, FIND_TIME) for node_id, node in nodes.items()}
        booted = _boot_all(cell, dictionaries, nodes, comms, on_report, on_program)
        ports = {name: comms[axis.node].ports.get(name) for name, axis in cell.axes.items()}
        there = {name: port for name, port in ports.items() if port is not None}
        events = {node_id: NodeEvents(nodes[node_id].nmt) for node_id, one in booted.items() if one.report.ok}
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
            ready=_nothing if consumer is None else consumer.await_steady,
            bus_time=TimeConsumer(channel, cell.bus.time_cob_id).at,
            bus_events=lambda: tuple(channel.controller.events),
            drops=lambda: channel.drops.found,
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
    if bus.interface != SIMULATED:
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
    on_program: OnProgram | None,
) -> dict[int, Booted]:
    def boot(node_id: int) -> Booted:
        progress = None if on_program is None else partial(on_program, node_id)
        sdo = nodes[node_id].sdo
        booted = NodeBoot(cell, node_id, dictionaries[node_id], sdo, comms[node_id], progress).run()
        if on_report is not None:
            on_report(booted)
        return booted

    return dict(zip(nodes, in_parallel(boot, nodes), strict=True))


def _boot_late(
    cell: CellConfig, node: Node, eds: Eds, cycle: CanCycle, access: dict[int, NodeAccess]
) -> tuple[Booted, Mapping[str, Port]]:
    """Boot an optional node that has appeared while the scan runs, and let the scan's cycle serve it."""
    comms = CanComms(cell, node, FIND_TIME)
    booted = NodeBoot(cell, node.node_id, eds, node.sdo, comms, late=True).run()
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
