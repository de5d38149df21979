"""A master of a few lines for simulated drives on a bus."""

from __future__ import annotations

import time
from pathlib import Path

from axisbus.bus.cycle import CanCycle
from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.configure import configure
from axisbus.bus.pdo.plan import PdoRequirements, Policy
from axisbus.bus.port import CanPort
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia402.port import Inputs, Outputs

EDS = Path(__file__).parents[3] / "eds" / "generic-cia402.eds"
PERIOD = 0.005


class Master:
    """A scan of a few lines: the same outputs for all ports in every cycle."""

    def __init__(self, channel: Channel, nodes: list[CanopenNode], policy: Policy) -> None:
        self.ports = []
        for node in nodes:
            node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
            plan = configure(node.sdo, PdoRequirements(), policy)
            self.ports.append(CanPort(node, plan, scan_period=PERIOD))
            node.command(NmtCommand.START)
            self.ports[-1].prime()
        self.cycle = CanCycle(
            channel, self.ports, sync_cob_id=0x80 if policy.sync else None, master_id=127, heartbeat=0.05
        )
        self._next = self.cycle.now()

    def until(self, statusword: int, mask: int, outputs: Outputs, seconds: float = 10.0) -> list[Inputs]:
        """Cycle until every drive shows the statusword; return the last inputs."""
        deadline = time.monotonic() + seconds
        while True:
            self.cycle.wait_until(self._next)
            self._next = max(self._next + PERIOD, self.cycle.now())
            self.cycle.receive()
            seen = [port.read(self.cycle.now()) for port in self.ports]
            if all(i.statusword is not None and i.statusword.value & mask == statusword for i in seen):
                return seen
            assert time.monotonic() < deadline, seen
            for port in self.ports:
                port.write(outputs)
            self.cycle.commit()
            self.cycle.sync()
            self.cycle.heartbeat()
