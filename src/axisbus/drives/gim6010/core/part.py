"""The part of the plug-in that runs the modules of a cell on a channel with CANopen nodes, simulates them, and stops them.

A ``ModuleSender`` is a ``cia402.port.Port`` for the scan, and a sender in the cycle of the bus (``bus.cycle.CycleSender``).
Received frames are stored with their stamp, in any thread, and processed at the beginning of a cycle. The frames of a stop are made
together with those of a cycle, so that another thread that finds the scan dead only has to send them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn

from axisbus.boot.report import Booted
from axisbus.bus.link.channel import Channel
from axisbus.bus.node.events import NodeEvents
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import objects_refused
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.incident import EmcyLog
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia402.port import Capabilities, Inputs, Outputs, Port
from axisbus.core.node_access_parts import NodeParts
from axisbus.core.other_protocols import CorePart, SimulatedForeignNode
from axisbus.core.simulated_nodes import SimulatedNode
from axisbus.drives.gim6010.boot.module import ModuleBoot
from axisbus.drives.gim6010.bus.run import frames_of
from axisbus.drives.gim6010.bus.stop_modules import stop_modules
from axisbus.drives.gim6010.can_simple.port.port import ModulePort
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.can_simple.port.synthetic_eds import description
from axisbus.drives.gim6010.cell import modules_of, no_objects, settings_by_axis, settings_of
from axisbus.drives.gim6010.sim.constants import FACTORY, Firmware
from axisbus.drives.gim6010.sim.module import Module
from axisbus.drives.registry import make_of
from axisbus.errors import BusError, StateError
from axisbus.link import StopResult

_LENGTH = 8
_KEPT = 1000  # queued frames: more means that the scan does not run
_Stop = tuple[tuple[tuple[int, bytes], ...], tuple[tuple[int, bytes], ...]]


class ModuleSender:
    """Holds the port of a module, its received frames, and the frames to send in this cycle."""

    asks = True  # requests messages by remote frames

    def __init__(self, channel: Channel, settings: ModuleSettings) -> None:
        """Listen on ``channel`` from now on."""
        self.port = ModulePort(settings)
        self.node = ModuleNode(self.port)
        self._restarts = 0
        self._bus_off_count = channel.bus_off_count
        self._channel = channel
        self._heard: deque[CanFrame] = deque(maxlen=_KEPT)
        self._listening = ExitStack()
        self._listening.enter_context(frames_of(channel, settings.node, self._heard))
        self._requests: list[tuple[int, int]] = []
        self._stop: _Stop = ((), ())

    @property
    def node_id(self) -> int:
        return self.port.settings.node

    # -- the scan's port ---------------------------------------------------------------------------------------------

    @property
    def capabilities(self) -> Capabilities:
        return self.port.capabilities

    def read(self, now: float) -> Inputs:
        """As ``Port.read``; processes the received frames first."""
        self.prime()
        inputs = self.port.read(now)
        for emcy in inputs.emcy:
            self.node.emcy.note(emcy)
        off = self._bus_off()
        return inputs if off is None else inputs._replace(operational=False, bus=off)

    def prime(self) -> None:
        """Process the received frames, before the first cycle and in each."""
        while self._heard:
            frame = self._heard.popleft()
            self.port.receive(frame, frame.time)
        hearing = self.port.hearing
        if hearing.bootups != self._restarts:
            self._restarts = hearing.bootups
            self.node.emcy.incidents.booted(hearing.bootup_stamp or 0.0)

    def write(self, outputs: Outputs) -> None:
        self.port.write(outputs)

    # -- the cycle of the bus ----------------------------------------------------------------------------------------

    def take_frames(self) -> list[tuple[int, bytes]]:
        frames = self.port.take_frames()
        self._requests = [(each.can_id, _LENGTH) for each in frames if each.remote]
        self._stop = (tuple((each.can_id, each.data) for each in self.port.stop_frames()), ())
        return [(each.can_id, each.data) for each in frames if not each.remote]

    def drop_frames(self) -> None:
        """As ``CycleSender.drop_frames``: no frame is sent again, so the values given to the module no longer count."""
        self.take_frames()
        self._requests = []
        self.port.forget()

    begin_again = drop_frames

    def take_requests(self, now: float) -> list[tuple[int, int]]:  # noqa: ARG002  # the port has decided that
        requests, self._requests = self._requests, []
        return requests

    def stop_frames(self) -> _Stop:
        """As ``CycleSender.stop_frames``; from any thread."""
        return self._stop

    def close(self) -> None:
        self._listening.close()

    def _bus_off(self) -> BusError | None:
        """Return the reason of a bus-off, at least once for each bus-off, however short it was."""
        bus_off_count, self._bus_off_count = self._bus_off_count, self._channel.bus_off_count
        if self._channel.off is None and bus_off_count == self._bus_off_count:
            return None
        return self._channel.off or self._channel.last_bus_off


# ----------------------------------------------------------------------------------------------------------------------
# A module as a node for direct access: state, faults and restarts by its heartbeats; no objects and no NMT commands.


@dataclass(frozen=True, slots=True)
class NoObjects:
    """The objects of a module (``boot.objects.NodeObjects``), which has none. Each access is refused, and nothing is sent."""

    node_id: int

    def read(self, *where: Any, **_: Any) -> NoReturn:
        """Refuse; ``where`` begins with index and sub-index. Raises StateError."""
        key, subindex = (*where, 0)[:2]
        raise no_objects(self.node_id, f"it has no object dictionary, so it has no {key:04X}h:{subindex:02X}")

    write = write_unchecked = upload = download = read


class ModuleNode:
    """One module (``core.node_access_parts.NodeParts.node``); holds the log of its faults, as emergency messages."""

    def __init__(self, port: ModulePort) -> None:
        self.node_id = port.settings.node
        self.nmt = port.hearing
        self.emcy = EmcyLog()
        self.pdo_events = port.hearing.missing  # of its messages: it has no PDOs

    def command(self, command: NmtCommand, timeout: float = 2.0) -> None:  # noqa: ARG002
        """Refuse; raises StateError."""
        raise no_objects(
            self.node_id,
            f"it has no NMT states, so it does not accept {command.name.lower().replace('_', ' ')}",
        )


class CanSimpleModules:
    """Holds the sender of each module, from the opening of the bus on, and its boot result."""

    def __init__(self, cell: CellConfig, channel: Channel) -> None:
        """Begin to listen; nothing is sent."""
        self._cell = cell
        self._channel = channel
        self._senders = {
            node_id: ModuleSender(channel, settings_of(cell, node_id)) for node_id in modules_of(cell)
        }
        self._booted: dict[int, Booted] = {}
        self._events: dict[int, NodeEvents] = {}

    def __contains__(self, node_id: int) -> bool:
        return node_id in self._senders

    def boot(self, node_id: int, find_time: float) -> Booted:
        """As ``CellConnection.boot``, before the scan begins; ``find_time`` (s) is the limit for the first heartbeat."""
        sender = self._senders[node_id]
        port = sender.port
        boot = ModuleBoot(self._cell, port.settings, port.objects, self._channel, find_time)
        booted = boot.run()
        port.feed_within(boot.feed_within)
        self._booted[node_id] = booted
        return booted

    def begin(self) -> None:
        """Process the frames received so far before the scan begins, so that no module counts as unknown, or as lost."""
        for sender in self.senders:
            sender.prime()
            self._events[sender.node_id] = NodeEvents(sender.node.nmt)

    @property
    def senders(self) -> list[ModuleSender]:
        """The booted modules, for the cycle."""
        return [self._senders[node_id] for node_id, booted in self._booted.items() if booted.report.ok]

    @property
    def events(self) -> list[NodeEvents]:
        return list(self._events.values())

    def ports(self, node_id: int) -> dict[str, Port]:
        return dict.fromkeys(self._booted[node_id].parameters, self._senders[node_id])

    def parts(self, node_id: int) -> NodeParts:
        sender = self._senders[node_id]
        eds = description(sender.port.settings)
        return NodeParts(
            node_id,
            eds,
            NoObjects(node_id),
            sender.node,
            self._channel.clock,
            events=self._events.get(node_id),
            objects_refused=objects_refused(self._cell, node_id),
            make=make_of(eds),
        )

    def close(self) -> None:
        for sender in self._senders.values():
            sender.close()


# -- The simulated modules of a cell, and the user's access to one -----------------------------------------------------


_COUNTS = 16384  # in a turn of its rotor


class ModuleStandIn(SimulatedNode):
    """One simulated module: ``module`` has its shaft and its fault settings (``dials``); for any thread."""

    def __init__(self, module: Module, lock: AbstractContextManager[object]) -> None:
        self.module = module
        self.lock = lock

    def history(self) -> tuple[float, float, int]:
        """As ``SimulatedNode.history``; the stage is the state of the module's axis: 1 is idle, 8 closed loop."""
        module = self.module
        return module.position * _COUNTS, module.shaft.speed * _COUNTS, int(module.axis.state)

    def drive(self, axis: int = 1) -> NoReturn:  # noqa: ARG002
        """Refuse: the motor is in ``module``."""
        raise StateError(
            f"node {self.module.node_id} is simulated as a module with CAN Simple, and has no CiA 402 drive",
            remedy="use .module: .module.shaft is its motor, .module.dials are its fault settings",
        )

    def fault(self, code: int, maker_bits: int = 0, axis: int = 1) -> None:  # noqa: ARG002
        """Put the module into fault with these bits of its motor's error word (``maker_bits``, else ``code``)."""
        with self.lock:
            self.module.dials.motor_error = maker_bits or code


def simulated_modules(cell: CellConfig) -> dict[int, SimulatedForeignNode]:
    """Make the modules of a cell, with their settings in the cell file; raises as ``settings_of``."""
    made = {node_id: _module(cell, node_id) for node_id in modules_of(cell)}
    return {
        node_id: SimulatedForeignNode(each, partial(ModuleStandIn, each)) for node_id, each in made.items()
    }


def _module(cell: CellConfig, node_id: int) -> Module:
    settings, firmware = settings_of(cell, node_id), cell.nodes[node_id].firmware
    own: dict[str, Any] = {"vel_ramp_rate": settings.velocity_ramp}
    if settings.torque is not None:
        own |= {
            "torque_ramp_rate": settings.torque.ramp,
            "axis0.motor.config.torque_constant": settings.torque.constant,
        }
    if settings.filter_bandwidth is not None:
        own["input_filter_bandwidth"] = settings.filter_bandwidth
    version = FACTORY if firmware is None else Firmware.read(firmware.removeprefix("v"))
    return Module(node_id, firmware=version, serial=node_id, **own)


# -- Stop modules on a channel without the scan, as ``core.node_stop`` does for CANopen nodes --------------------------


def stop_axes(cell: CellConfig, channel: Channel, names: Collection[str]) -> list[StopResult]:
    """Stop the axes of these names that belong to modules. Blocks as ``stop_modules``."""
    return stop_modules(channel, settings_by_axis(cell, names))


def holding(cell: CellConfig) -> frozenset[str]:
    """Return the axes of modules whose stop holds their position."""
    settings = settings_by_axis(cell, cell.driven)
    return frozenset(name for name, each in settings.items() if each.quick_stop_holds)


PART = CorePart(nodes=CanSimpleModules, stop=stop_axes, holding=holding, simulated=simulated_modules)
