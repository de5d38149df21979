"""A slave on the fake bus, and the port of its axis."""

from __future__ import annotations

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.bus.pdo.plan import PdoRequirements, Policy, make_plan
from axisbus.bus.port import CanPort
from kit.bus.fake_bus import FakeBus, Slave
from kit.bus.pdo_configurations import objects, rpdo, tpdo

WANTED = PdoRequirements(("statusword",), ("controlword", "target_position"))


def slave_of(fake: FakeBus, node_id: int) -> Slave:
    slave = Slave(node_id, {(0x6041, 0): b"\x31\x02", (0x607A, 0): bytes(4), (0x6040, 0): b"\0\0"})
    slave.nmt_state = 5
    fake.peers.append(slave)
    return slave


def port_of(channel: Channel, node_id: int, rpdos: tuple[str, ...] = ("6040/16 607A/32",)) -> CanPort:
    base = 0x200 + node_id
    device = DevicePdos(
        tuple(rpdo(n, text, 1, cob_id=base + 0x100 * (n - 1)) for n, text in enumerate(rpdos, start=1)),
        (tpdo(1, "6041/16", 1, cob_id=0x180 + node_id),),
    )
    plan = make_plan(node_id, device, objects(), WANTED, Policy(remap=False))
    port = CanPort(CanopenNode(channel, node_id), plan, scan_period=0.004)
    port.prime()
    return port
