"""The part of the plug-in that runs the modules of a cell on a channel with CANopen nodes, simulates them, and stops them."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import AbstractContextManager
from functools import partial
from typing import Any, NoReturn

from axisbus.boot.report import Booted
from axisbus.bus.link.channel import Channel
from axisbus.bus.node.events import NodeEvents
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import objects_refused
from axisbus.cia402.port import Port
from axisbus.core.node_access_parts import NodeParts
from axisbus.core.other_protocols import CorePart, SimulatedGuest
from axisbus.core.simulated_nodes import SimulatedNode
from axisbus.drives.gim6010.boot.module import ModuleBoot
from axisbus.drives.gim6010.bus.stop_modules import stop_modules
from axisbus.drives.gim6010.can_simple.port.synthetic_eds import description
from axisbus.drives.gim6010.cell import modules_of, settings_by_axis, settings_of
from axisbus.drives.gim6010.core.module_port import ModuleSender, NoObjects
from axisbus.drives.gim6010.sim.constants import FACTORY, Firmware
from axisbus.drives.gim6010.sim.module import Module
from axisbus.drives.registry import make_of
from axisbus.errors import StateError
from axisbus.link import StopResult


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


def simulated_modules(cell: CellConfig) -> dict[int, SimulatedGuest]:
    """Make the modules of a cell, with their settings in the cell file; raises as ``settings_of``."""
    made = {node_id: _module(cell, node_id) for node_id in modules_of(cell)}
    return {node_id: SimulatedGuest(each, partial(ModuleStandIn, each)) for node_id, each in made.items()}


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


PART = CorePart(
    nodes=CanSimpleModules,
    stop=stop_axes,
    holding=holding,
    simulated=simulated_modules,
)
