"""Axes of ours on drives that answer at once: enabled, and on a trajectory."""

from __future__ import annotations

import time
from itertools import cycle
from types import SimpleNamespace

import can

from axisbus.bus.cycle import CanCycle
from axisbus.bus.link.channel import Channel
from axisbus.bus.link.raw_sockets import CyclicSocket
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.bus.pdo.plan import PdoRequirements, Policy, make_plan
from axisbus.bus.port import CanPort
from axisbus.cia301.nmt import NmtState
from axisbus.core.inprocess import InProcess
from axisbus.core.realtime_setup import SPIN, wake_in_time
from axisbus.core.scan import Scan
from axisbus.core.waiting import ThreadWaiter
from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.handle import Handle
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.bus.pdo_configurations import objects, rpdo, tpdo
from kit.motion.rig import GENERIC, dictionary_of, parameters

OUTPUTS = ("controlword", "mode", "target_position")
INPUTS = ("statusword", "mode", "position")


class Cell:
    """A scan over ``count`` ports on an open bus, every axis enabled; nothing was booted, the drives need none."""

    def __init__(self, bus: can.BusABC, cyclic: CyclicSocket | None, count: int, period: float) -> None:
        self.channel = Channel(bus, "socketcan:bench", cyclic=cyclic)
        self.nodes = [CanopenNode(self.channel, node_id) for node_id in range(1, count + 1)]
        ports = [self._port(node, period) for node in self.nodes]
        self.cycle = CanCycle(self.channel, ports, master_id=127, heartbeat=0.1, spin=SPIN)
        cores = {
            f"a{port.node.node_id}": AxisCore(self._parameters(port, period), port.capabilities)
            for port in ports
        }
        self.scan = Scan(self.cycle, dict(zip(cores, ports, strict=True)), cores, period)
        self.scan.waiter = waiter = ThreadWaiter()
        commanding = CommandDispatcher(InProcess(self.scan, waiter, SimpleNamespace(nodes={}, link=None)))
        self.axes = {name: Axis(core.parameters, commanding) for name, core in cores.items()}
        self.commands: list[Handle] = []
        self._turns = cycle(self.axes)

    @staticmethod
    def _port(node: CanopenNode, period: float) -> CanPort:
        number = node.node_id
        device = DevicePdos(
            (rpdo(1, "607A/32 6060/8 6040/16", 1, cob_id=0x200 + number),),
            (tpdo(1, "6041/16 6061/8 6064/32", 1, cob_id=0x180 + number),),
        )
        plan = make_plan(number, device, objects(), PdoRequirements(INPUTS, OUTPUTS), Policy(remap=False))
        port = CanPort(node, plan, scan_period=period)
        port.prime()
        node.nmt.state = NmtState.OPERATIONAL
        return port

    @staticmethod
    def _parameters(port: CanPort, period: float):
        there = frozenset({0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x607A})
        return parameters(
            f"a{port.node.node_id}",
            dictionary_of(GENERIC),
            objects=there,
            modes=frozenset({8}),
            scan_period=period,
            node=port.node.node_id,
        )

    def run(self) -> None:
        """Scan, in the calling thread."""
        wake_in_time()
        self.scan.run()

    def follow(self, speed: float) -> None:
        """Enable every axis and start a long motion at ``speed`` in deg/s."""
        while len(self.scan.snapshots) < len(self.axes) or None in [
            one.statusword for one in self.scan.snapshots.values()
        ]:
            time.sleep(0.01)
        for handle in [axis.enable() for axis in self.axes.values()]:
            handle.wait(5)
        self.handles = [
            axis.follow(TrapezoidalTrajectory(0.0, 10_000.0, speed, 400.0)) for axis in self.axes.values()
        ]

    def command(self) -> None:
        """Give one axis after the other a command that leaves it in motion."""
        name = next(self._turns)
        self.commands.append(self.axes[name].enable())

    def must_follow(self) -> None:
        """Raise where an axis does not follow, or did not take a command."""
        assert all(command.exception() is None for command in self.commands[:-1]), self.commands
        for handle, axis in zip(self.handles, self.axes.values(), strict=True):
            if not handle.active:
                raise AssertionError(f"{handle}: {handle.error}")
            assert axis.position > 0.0, axis

    def close(self) -> None:
        """Release everything."""
        for node in self.nodes:
            node.close()
        self.channel.close()
