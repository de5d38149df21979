"""The services of one node on a bus that boot-up needs beside SDO: NMT, error control, PDOs."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace

from axisbus.boot.configure import HEARTBEATS
from axisbus.bus.cycle import CycleSender
from axisbus.bus.io_port import CanIoPort
from axisbus.bus.node.nmt import guarding_answer
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.cob_id_conflicts import CobIdUses, uses_of
from axisbus.bus.pdo.cob_id_conflicts import error as conflict
from axisbus.bus.pdo.configure import configure, configure_io, set_pdo
from axisbus.bus.pdo.eventtimer import EventTimer
from axisbus.bus.pdo.plan import PdoRequirements
from axisbus.bus.pdo.read import read_number
from axisbus.bus.pdo.rpdo import REPEAT
from axisbus.bus.pdo.setpoint_edge_order import CONTROLWORD
from axisbus.bus.port import CanPort
from axisbus.cell.cyclic_modes import wanted_of
from axisbus.cell.model import AxisConfig, CellConfig
from axisbus.cell.pdo_plan import io_objects, policy_of
from axisbus.cell.pdo_tables import map_entry
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.emcy import Emcy
from axisbus.cia301.nmt import RESULT, NmtCommand, NmtState
from axisbus.cia302.types import DEADLINE, LEAST_CONSUMER
from axisbus.cia401.signal import IoPoint, addresses
from axisbus.cia402 import dictionary as catalogue
from axisbus.cia402.axes import own_index
from axisbus.cia402.port import (
    ALL_OUTPUTS,
    INTERPOLATION_OBJECTS,
    OFFSET_OBJECTS,
    Capabilities,
    ValueTransport,
)
from axisbus.errors import BootError, NodeTimeout

_WHAT = {
    **dict.fromkeys(OFFSET_OBJECTS, "its feed-forward"),
    **dict.fromkeys(INTERPOLATION_OBJECTS, "its set-points of ip"),
}
_REMEDY = {
    **dict.fromkeys(OFFSET_OBJECTS, "delete the keys that need it in [axes.{name}.feed_forward]"),
    **dict.fromkeys(INTERPOLATION_OBJECTS, "leave ip and csp out of modes in [axes.{name}]"),
}
_WHY = {
    ValueTransport.NONE: "the drive does not have it",
    ValueTransport.SDO: "none of its RPDOs contains it: it would be sent by SDO, too late for the motion",
    ValueTransport.EVENT_PDO: "its RPDO is event-driven",
}


def _require_synchronous(
    axis: AxisConfig, names: Collection[str], outputs: Mapping[str, ValueTransport]
) -> None:
    """Check that all of ``names``, the special outputs of an axis, travel in a synchronous PDO.

    Raises:
        BootError: one of them does not; the master has not sent it yet.
    """
    for name in sorted(names, key=ALL_OUTPUTS.__getitem__):
        source = outputs.get(name, ValueTransport.NONE)
        if source is not ValueTransport.SYNC_PDO:
            index = own_index(ALL_OUTPUTS[name], axis.drive_axis)
            raise BootError(
                f"axis {axis.name}: {_WHAT[name]} cannot be sent by {index:04X}h ({catalogue.name(ALL_OUTPUTS[name])})",
                node=axis.node,
                step="PDO configuration",
                index=index,
                observed=_WHY[source],
                remedy=f"{_REMEDY[name].format(name=axis.name)}, or allow remapping of the node, with sync = true in [bus]",
            )


BUSY_TIME = 2.0  # seconds for which a node may be busy during its boot-up, in all


class NodeServices:
    """NMT and the time limits of SDO for one node; needs no cell file."""

    def __init__(self, node: CanopenNode) -> None:
        self.clock = node.channel.clock
        self._node = node

    def command(self, command: NmtCommand, deadline: float, *, always: bool = False) -> NmtState:
        """Send an NMT command and wait for its confirmation; send nothing if the node already reports the requested state. Blocks.

        ``always``: send it in any case.

        Raises:
            NodeTimeout: the node does not confirm it within ``deadline`` seconds.
        """
        monitor = self._node.nmt
        if always or monitor.assumed or monitor.state is not RESULT[command]:
            self._node.command(command, deadline)
        return monitor.state

    def listen(self, deadline: float) -> NmtState | None:
        """Return the state of the next heartbeat, None if none comes within ``deadline`` seconds; blocks."""
        monitor = self._node.nmt
        return monitor.state if monitor.wait_report(monitor.reports, deadline) else None

    def ask(self, deadline: float) -> NmtState | None:
        """Return the node's state by node guarding, None if no answer comes; blocks for at most ``deadline`` seconds."""
        return guarding_answer(self._node.channel, self._node.nmt, deadline)

    def pause(self, seconds: float) -> None:
        """Wait for ``seconds``; blocks."""
        self.clock.sleep(seconds)

    def repeating_busy(self) -> AbstractContextManager[None]:
        """Inside the ``with`` block, repeat SDO requests that the node refuses because it is busy, for ``BUSY_TIME`` in all."""
        return self._node.sdo.repeating_busy(BUSY_TIME)

    @contextmanager
    def trying(self, tries: int, deadline: float) -> Iterator[None]:
        """Inside the ``with`` block, make each SDO request up to ``tries`` times with ``deadline`` seconds each."""
        sdo = self._node.sdo
        before = sdo.tries, sdo.timeout
        sdo.tries, sdo.timeout = tries, deadline
        try:
            yield
        finally:
            sdo.tries, sdo.timeout = before


class CanComms(NodeServices):
    """The bus services that the boot-up of one node needs; holds the ports that it has made."""

    def __init__(
        self,
        cell: CellConfig,
        node: CanopenNode,
        find_time: float,
        begin_heartbeat: Callable[[], None],
        cob_ids: CobIdUses,
    ) -> None:
        """``find_time``: seconds allowed for the node's first answer; ``begin_heartbeat`` starts the master's heartbeat.

        ``cob_ids``: the PDOs of all nodes of the cell.
        """
        super().__init__(node)
        self.begin_heartbeat = begin_heartbeat
        self._cell = cell
        self._config = cell.nodes[node.node_id]
        self._tables = self._config.pdos
        self._find_time = find_time
        self._cob_ids = cob_ids
        self.ports: dict[str, CanPort] = {}
        self.io: CanIoPort | None = None
        self.guarding: float | None = None

    # -- services for boot-up -----------------------------------------------------------------------------------------

    @property
    def find_tries(self) -> int:
        """How many tries fit into ``find_time``; at least 1."""
        return max(1, math.ceil(self._find_time / DEADLINE - 1e-9) - 1)

    def last_emcy(self) -> tuple[Emcy, float] | None:
        """The node's last emergency message and its age in seconds; None if none has come."""
        history = self._node.emcy.history
        return (history[-1], self.clock.now() - history[-1].stamp) if history else None

    def restarts(self) -> int:
        """The number of boot-up messages received from the node."""
        return self._node.nmt.bootups

    def no_answer_error(self) -> NodeTimeout:
        """Return the error of a node that does not answer, with the known state of the node and of the bus."""
        channel = self._node.channel
        health = channel.health() or f"nothing is wrong with the channel {channel.name} itself"
        seen = self._node.nmt.describe(self.clock.now())
        return NodeTimeout(
            f"node {self._node.node_id} does not answer",
            node=self._node.node_id,
            observed=f"no answer to the SDO request for 1000h within {self._find_time:g} s, {seen}; {health}",
            remedy="check its supply, cable and termination, its node ID and bit rate (axisbus scan lists the nodes)",
        )

    def connect(self, axis: AxisConfig, *, disturb: bool) -> Capabilities:
        """Plan and set the PDOs of an axis, make its port, and load the port with the drive's present values.

        If ``disturb`` is false, the drive keeps its PDOs as they are.
        """
        if disturb:
            self._set_tables()
        usual = policy_of(self._cell, self._config)
        policy = replace(usual, remap=disturb and usual.remap, communication=disturb, timers=disturb)
        also = [(table.receive, table.number) for table in self._config.pdos]
        wanted = wanted_of(axis, self._config, self._node.sdo.dictionary.eds, self._cell.bus.sync)
        plan = configure(self._node.sdo, wanted, policy, axis.drive_axis, also=also)
        if disturb:
            _require_synchronous(axis, wanted.synchronous_outputs, plan.outputs)
        elif plan.impossible:  # the drive is left as it was found, and the axis works without these PDOs
            plan = configure(self._node.sdo, PdoRequirements(), policy, axis.drive_axis, also=also)
        port = CanPort(
            self._node,
            plan,
            scan_period=self._cell.bus.scan_period,
            remappable=self._config.remappable,
            foreign_sync=self._cell.bus.hears_sync,
            # As often as a heartbeat: the RPDO's deadline may be 3 heartbeats (``DriveMonitoringSetup.arm_deadlines``).
            rpdo_repeat=min(REPEAT, self._cell.bus.heartbeat or REPEAT),
        )
        port.prime()
        self.ports[axis.name] = port
        return port.capabilities

    def close(self) -> None:
        """Close the ports, if they are not used because the boot-up has failed."""
        for sender in self.senders:
            sender.close()

    @property
    def senders(self) -> list[CycleSender]:
        """All ports of the node that send frames in a cycle."""
        return [*self.ports.values(), *([] if self.io is None else [self.io])]

    def connect_io(self, points: Sequence[IoPoint]) -> str:
        """Plan and set the PDOs of the node's inputs and outputs, beside those of its axes, and make their port.

        Returns the planned PDOs and their values as text.
        """
        self._set_tables()
        sdo = self._node.sdo
        used = {(pdo.receive, pdo.target.number) for port in self.ports.values() for pdo in port.plan.active}
        also = [(table.receive, table.number) for table in self._config.pdos]
        objects = io_objects(points, sdo.dictionary)
        plan = configure_io(sdo, objects, policy_of(self._cell, self._config), used, also)
        inputs, outputs = (addresses(points, output=output) for output in (False, True))
        self.io = CanIoPort(
            self._node,
            plan,
            inputs,
            outputs,
            self._cell.bus.scan_period,
            foreign_sync=self._cell.bus.hears_sync,
        )
        self.io.prime()
        return "; ".join(f"{pdo.name}: {', '.join(filter(None, pdo.values))}" for pdo in plan.active)

    def separate_cob_ids(self, disturb: bool) -> list[str]:
        """Switch off unused PDOs that have a COB-ID of another node; return which, as texts. Blocks for a few transfers.

        Raises:
            BootError: a PDO in use has such a COB-ID, or one that is set by the cell file; or the drive refuses to switch it off,
                or nothing may be changed (``disturb``).
        """
        plans = [port.plan for port in self.ports.values()]
        plans += [] if self.io is None else [self.io.plan]
        own = {(table.receive, table.number) for table in self._config.pdos}
        texts = []
        node_id = self._node.node_id
        for use, other in self._cob_ids.conflicts(node_id, uses_of(node_id, plans)):
            if use.used or not disturb or (use.receive, use.number) in own:
                raise conflict(use, other)
            try:
                set_pdo(self._node.sdo, use.receive, use.number, on=False)
            except BootError as error:
                raise conflict(use, other) from error
            self._cob_ids.drop(use)
            texts.append(f"{use.name} switched off: it has the COB-ID {use.cob_id:03X}h of {other.name}")
        return texts

    def event_timers(self, axis: AxisConfig) -> tuple[EventTimer, ...]:
        """Return the event timers that ``connect`` had to change, with the result of each change."""
        return self.ports[axis.name].plan.event_timers

    def _set_tables(self) -> None:
        """Set the PDOs of ``[nodes.N.pdo]``; only once, for all axes of the node."""
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

    def follow_emcy(self) -> None:
        """Listen to the node's emergency messages at the COB-ID of its 1014h, else at the default of CiA 301."""
        value = read_number(self._node.sdo, o.COB_ID_EMCY, 0)
        if value is not None and not value & cob.INVALID and value & cob.ID_MASK_11 not in (0, cob.EMCY):
            self._node.emcy.listen_to(value & cob.ID_MASK_11)

    def watch(self, timeout: float | None) -> None:
        """Monitor the node's heartbeat from now on; ``timeout`` in seconds."""
        self._node.nmt.watch(timeout)

    def guard(self, period: float) -> None:
        """Let the scan ask for the node's state every ``period`` seconds; the timeout equals that of heartbeats."""
        self.guarding = period
        if self._node.nmt.watched is None:
            self._node.nmt.guard(max(HEARTBEATS * period, LEAST_CONSUMER), period)

    def state(self) -> str:
        """The node's NMT state in words."""
        return self._node.nmt.state.text

    def cyclic_rpdos(self) -> list[int]:
        """The RPDO with the controlword, if there is exactly one: the scan sends it continuously from the first command on."""
        first = [_controlword_pdo(port) for port in self.ports.values()]
        return [number for number in first if number is not None]


def _controlword_pdo(port: CanPort) -> int | None:
    pdos = [pdo for pdo in port.plan.active if pdo.receive and CONTROLWORD in pdo.values]
    return pdos[0].target.number if len(pdos) == 1 else None
