"""The link to simulated drives in virtual time, without a bus."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from datetime import datetime
from functools import partial

from axisbus.boot.feed_forward import require_synchronous
from axisbus.boot.node import NodeBoot
from axisbus.boot.objects import DeviceObjects
from axisbus.boot.report import Booted
from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.node.events import NodeEvent, NodeEvents
from axisbus.bus.node.nmt import not_obeyed
from axisbus.bus.pdo.eventtimer import EventTimer
from axisbus.cell.can_simple.modules import modules_of
from axisbus.cell.cyclic_modes import more_outputs
from axisbus.cell.io_signals import points_of
from axisbus.cell.model import AxisConfig, CellConfig
from axisbus.cia301.dropped_frames import Drop
from axisbus.cia301.emcy import Emcy
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sdo_counts import SdoCount
from axisbus.cia401.port import IoPort
from axisbus.cia401.signal import IoPoint, addresses
from axisbus.cia402.port import ALL_OUTPUTS, INPUT_OBJECTS, OUTPUT_OBJECTS, Capabilities, Port, ValueTransport
from axisbus.core.can_simple.modules import CanSimpleModules
from axisbus.core.can_simple.simulated_modules import modules, stand_ins_of
from axisbus.core.can_simple.virtual import MixedCycle, VirtualLine
from axisbus.core.direct.node import DirectNode
from axisbus.core.io import make_safe
from axisbus.core.node_access_parts import NodeParts
from axisbus.core.simulated_nodes import SimulatedNode
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import NodeTimeout, SdoError, SecondMasterError
from axisbus.link import NodeShutdown, StopResult, Unsafe
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.direct import DirectCycle, DirectPort
from axisbus.sim.direct_io import DirectIoPort

_EVENT_TIMER = 0.02
_FIND_TIME = 0.5  # s for the first heartbeat of a module
_HEARTBEAT = (
    0.1  # seconds between those of a node, where [bus] says nothing: without any nothing could be known of it
)


class DirectComms:
    """What boot-up needs of a stand-in that is reached without a bus; ``io`` are its inputs and outputs once they are in use."""

    def __init__(
        self,
        device: Device,
        ports: Mapping[str, DirectPort],
        io: DirectIoPort | None = None,
        more: Mapping[str, Collection[str]] | None = None,
    ) -> None:
        """``more``: what each axis is sent beside the usual."""
        self._device = device
        self._ports = ports
        self._io = io
        self._more = more or {}
        self.io: DirectIoPort | None = None

    @property
    def find_tries(self) -> int:
        """Once: no time passes between two tries."""
        return 1

    def nobody(self) -> NodeTimeout:
        """Return the error of a stand-in that does not answer."""
        return NodeTimeout(
            f"node {self._device.node_id} does not answer",
            node=self._device.node_id,
            observed="no answer to the SDO request for 1000h",
            remedy="check its supply, cable, node ID and bit rate",
        )

    def last_emcy(self) -> tuple[Emcy, float] | None:
        """The last emergency message that it has sent and nobody has taken yet: no time has passed since."""
        waiting = self._device.errors.waiting(0.0)
        return (waiting[-1], 0.0) if waiting else None

    def restarts(self) -> int:
        """How often it has booted."""
        return self._device.boot_ups

    def command(self, command: NmtCommand, deadline: float) -> NmtState:  # noqa: ARG002 - no time passes here
        """Do what a node without a bus can do: restart, and start. Its objects may be written in any state.

        Raises:
            NodeTimeout: it does not start.
        """
        if command is NmtCommand.START:
            self._device.nmt_command(command)
            if not self._device.operational:
                state = self._device.nmt
                raise not_obeyed(self._device.node_id, command, state, f"NMT state {state.text}")
        elif command is NmtCommand.RESET_NODE:
            self._device.nmt_command(command)
            self._device.power_on()
            self._device.nmt_command(NmtCommand.START)
        return self._device.nmt

    def listen(self, deadline: float) -> NmtState | None:  # noqa: ARG002
        """Return its state, None where it sends no heartbeat."""
        dials = self._device.dials
        return None if dials.dead or dials.heartbeat_stops else self._device.nmt

    def ask(self, deadline: float) -> NmtState | None:  # noqa: ARG002
        """Return its state."""
        return None if self._device.dials.dead else self._device.nmt

    def pause(self, seconds: float) -> None:
        """Let the stand-in's time pass; one that has restarted meanwhile runs again, as in ``command``."""
        boots = self._device.boot_ups
        self._device.step(seconds)
        if self._device.boot_ups != boots:
            self._device.nmt_command(NmtCommand.START)

    def trying(self, tries: int, deadline: float) -> AbstractContextManager[None]:  # noqa: ARG002
        """Nothing is lost here."""
        return nullcontext()

    def connect(self, axis: AxisConfig, disturb: bool, sync_needed: bool) -> Capabilities:  # noqa: ARG002
        """Return how the values of an axis travel."""
        capabilities = self._ports[axis.name].capabilities
        require_synchronous(axis, self._more.get(axis.name, ()), capabilities.outputs)
        return capabilities

    def connect_io(self, points: Sequence[IoPoint]) -> str:  # noqa: ARG002  # of the same points
        """Use the port that the link has made for them."""
        self.io = self._io
        return "PDOs, in virtual time"

    def event_timers(self, axis: AxisConfig) -> tuple[EventTimer, ...]:  # noqa: ARG002
        """None: without a bus there are no PDOs."""
        return ()

    def begin_heartbeat(self) -> None:
        """The stand-in hears no frames, and misses none before its time runs."""

    def follow_emcy(self) -> None:
        """Nothing to do: the port has them."""

    def cyclic_rpdos(self) -> list[int]:
        """None: without a bus there are no PDOs."""
        return []

    def watch(self, timeout: float | None) -> None:
        """Nothing to do: the port watches."""

    def guard(self, period: float) -> None:
        """Nothing to do: there is no bus to guard over."""

    def state(self) -> str:
        """Its NMT state."""
        return self._device.nmt.text


class DirectLink:
    """A ``Link`` to stand-ins in virtual time, without a bus; holds them, and what booting each has made."""

    in_threads = False

    def __init__(
        self, cell: CellConfig, dictionaries: Mapping[int, Eds], devices: Mapping[int, Device] | None = None
    ) -> None:
        """Make the stand-ins of a cell, or take ``devices``.

        An optional one whose dial ``dead`` is on is absent, until it is turned off.
        """
        self._cell = cell
        self._dictionaries = dictionaries
        self._devices = devices or {
            node_id: device_from_eds(eds, node_id, seed=node_id) for node_id, eds in dictionaries.items()
        }
        self._ports = {
            name: _port(cell, axis, self._devices[axis.node])
            for name, axis in cell.driven.items()
            if axis.node in self._devices
        }
        self._io = {
            node_id: _io_port(cell, points, self._devices[node_id])
            for node_id, eds in dictionaries.items()
            if (points := points_of(cell, node_id, Dictionary(eds, node_id)))
        }
        self._io_used: dict[int, DirectIoPort] = {}
        self._booted: dict[int, Booted] = {}
        self._parts: dict[int, NodeParts] = {}
        guests = modules(cell)
        make = partial(MixedCycle, VirtualLine(guests)) if guests else DirectCycle
        self.cycle: DirectCycle = make(
            list(self._ports.values()),
            io=list(self._io.values()),
            master_id=cell.bus.master_id,
            heartbeat=cell.bus.heartbeat or 0.0,
            devices=[device for node_id, device in self._devices.items() if not any(cell.axes_of(node_id))],
        )
        self.stand_ins = {
            node_id: SimulatedNode(device, nullcontext()) for node_id, device in self._devices.items()
        } | stand_ins_of(guests, nullcontext())
        self._modules: CanSimpleModules | None = None
        if isinstance(self.cycle, MixedCycle):
            self._modules = _booted_modules(cell, self.cycle, self._booted)

    def boot(self, node_id: int) -> Booted:
        """As ``CellConnection.boot``, at first or when it has appeared."""
        if self._of_module(node_id):
            return self._booted[node_id]
        cell, eds, device = self._cell, self._dictionaries[node_id], self._devices[node_id]
        objects = DeviceObjects(device)
        sync = cell.bus.sync
        more = {
            axis.name: more_outputs(axis, cell.nodes[node_id], eds, sync) for axis in cell.axes_of(node_id)
        }
        comms = DirectComms(device, self._ports, self._io.get(node_id), more)
        booted = NodeBoot(cell, node_id, eds, objects, comms).run()
        heartbeat = cell.bus.heartbeat or _HEARTBEAT
        node = DirectNode(device, self.cycle.now(), heartbeat, lambda: self._hear(node_id))
        self._booted[node_id] = booted
        self._parts[node_id] = NodeParts(
            node_id,
            eds,
            objects,
            node,
            events=node.events if booted.report.ok else None,
            clock=self.cycle.now,
        )
        if booted.report.ok:
            self.cycle.listeners.append(lambda now, emcys: node.listen(now, emcys[node_id]))
            for port in self._own(node_id).values():
                port.know_state(self.cycle.now())
            if comms.io is not None:
                comms.io.know_state(self.cycle.now())
                self._io_used[node_id] = comms.io
        return booted

    def _hear(self, node_id: int) -> None:
        """Let the axes and the outputs of a node have the NMT state that has just been confirmed, as on a bus."""
        now = self.cycle.now()
        for port in self._own(node_id).values():
            port.hear_state(now)
        if (io := self._io_used.get(node_id)) is not None:
            io.hear_state(now)

    def begin(self) -> None:
        """Its cycle is there from the beginning; modules are served by it from now on."""
        if isinstance(self.cycle, MixedCycle) and self._modules is not None:
            self._modules.begin()
            self.cycle.senders = self._modules.senders
            self.cycle.listeners += [_looking(events) for events in self._modules.events]

    def ports(self, node_id: int) -> Mapping[str, Port]:
        """As ``CellConnection.ports``."""
        if self._modules is not None and node_id in self._modules:
            return self._modules.ports(node_id)
        return dict[str, Port](self._own(node_id))

    def io(self, node_id: int) -> IoPort | None:
        """As ``CellConnection.io``."""
        return self._io_used.get(node_id)

    def parts(self, node_id: int) -> NodeParts:
        """As ``CellConnection.parts``."""
        if self._modules is not None and node_id in self._modules:
            return self._modules.parts(node_id)
        return self._parts[node_id]

    def answers(self, node_id: int) -> bool:
        """As ``CellConnection.answers``."""
        return self._devices[node_id].answers_sdo

    def ready(self) -> None:
        """Nothing to wait for."""

    def rescue(self, names: Collection[str]) -> list[StopResult]:
        """Without the scan no virtual time passes, so nothing more can be done or seen here."""
        return [
            StopResult(name, False, "NOT CONFIRMED as stopped: virtual time stands still") for name in names
        ]

    def make_safe(self, points: Collection[IoPoint]) -> list[Unsafe]:
        """As ``CellConnection.make_safe``: SDO takes no time here."""
        objects = {node_id: DeviceObjects(device) for node_id, device in self._devices.items()}
        return make_safe(objects, points)

    def leave(self, how: Mapping[int, NodeShutdown]) -> None:
        """As ``CellConnection.leave``."""
        for node_id, node in self._booted.items():
            if how[node_id] is not NodeShutdown.ARMED and node.watch is not None:
                with suppress(SdoError):  # a node that is gone cannot be let go
                    node.watch.restore()
            if how[node_id] is NodeShutdown.REST and node.report.ok and not self._of_module(node_id):
                self._devices[node_id].nmt_command(NmtCommand.ENTER_PRE_OPERATIONAL)

    def close(self) -> None:
        """As ``CellConnection.close``."""
        self.cycle.close()

    def bus_time(self, now: float) -> datetime | None:  # noqa: ARG002  # there is no TIME
        """None: nobody sends TIME."""
        return None

    def incidents(self) -> Sequence[ControllerEvent]:
        """None: there is no adapter."""
        return ()

    def other_masters(self) -> Sequence[NodeEvent]:
        """None: there is no bus."""
        return ()

    def on_command_of_others(self, call: Callable[[SecondMasterError, frozenset[int]], None]) -> None:
        """As ``CellConnection.on_command_of_others``: there is no bus."""

    def drops(self) -> Sequence[Drop]:
        """None: there are no frames."""
        return ()

    def sdo_counts(self) -> Sequence[SdoCount]:
        """None: there are no frames."""
        return ()

    def carried(self) -> None:
        """None: there are no frames."""

    def tap(self, ear: Callable[[CanFrame], None]) -> None:
        """As ``CellConnection.tap``: there are no frames."""

    def untap(self, ear: Callable[[CanFrame], None]) -> None:
        """As ``CellConnection.untap``."""

    def _of_module(self, node_id: int) -> bool:
        return self._modules is not None and node_id in self._modules

    def _own(self, node_id: int) -> dict[str, DirectPort]:
        return {axis.name: self._ports[axis.name] for axis in self._cell.axes_of(node_id)}


def _booted_modules(cell: CellConfig, cycle: MixedCycle, booted: dict[int, Booted]) -> CanSimpleModules:
    """Boot the modules, before any other node expects our heartbeat: time passes meanwhile."""
    found = CanSimpleModules(cell, cycle.line, clock=cycle.now, sleep=cycle.sleep)
    for node_id in modules_of(cell):
        booted[node_id] = found.boot(node_id, _FIND_TIME)
    return found


def _looking(events: NodeEvents) -> Callable[[float, Mapping[int, tuple[Emcy, ...]]], None]:
    return lambda now, _: events.look(now)


def _io_port(cell: CellConfig, points: Sequence[IoPoint], device: Device) -> DirectIoPort:
    inputs, outputs = (addresses(points, output=output) for output in (False, True))
    heartbeat = cell.bus.heartbeat or _HEARTBEAT
    return DirectIoPort(device, inputs, outputs, sync=cell.bus.sync, heartbeat=heartbeat)


def _port(cell: CellConfig, axis: AxisConfig, device: Device) -> DirectPort:
    heartbeat = cell.bus.heartbeat or _HEARTBEAT
    has = device.dictionary.has
    offset = 0x800 * (axis.drive_axis - 1)
    if cell.bus.sync:
        asked = more_outputs(axis, cell.nodes[axis.node], device.eds)
        more = {name: ValueTransport.SYNC_PDO for name in asked if ALL_OUTPUTS[name] + offset in device.eds}
        return DirectPort(device, axis.drive_axis - 1, outputs=more, node_heartbeat=heartbeat)
    return DirectPort(
        device,
        axis.drive_axis - 1,
        inputs={
            name: ValueTransport.EVENT_PDO for name, index in INPUT_OBJECTS.items() if has(index + offset)
        },
        outputs={
            name: ValueTransport.EVENT_PDO for name, index in OUTPUT_OBJECTS.items() if has(index + offset)
        },
        event_timer=_EVENT_TIMER,
        node_heartbeat=heartbeat,
    )
