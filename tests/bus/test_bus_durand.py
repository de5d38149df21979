"""Our SDO, PDO and NMT against an independent responder: durand, on python-can's virtual bus."""

from __future__ import annotations

import itertools
import random
import struct
from collections.abc import Iterator

import can
import durand
import pytest
from durand.datatypes import DatatypeEnum
from durand.node import NodeCapabilities
from durand.scheduler import VirtualScheduler

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.nmt import Confirmation
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.configure import set_pdo
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.pdo import MappedObject
from axisbus.cia301.sdo import SdoTransferType
from axisbus.errors import SdoAbort
from kit.bus.fake_bus import eventually

NODE = 5
BIG = random.Random(402).randbytes(65536)
PATIENCE = 10.0  # seconds for one answer; generous, because the machine may be busy
_names = itertools.count()


class Peer:
    """A durand node with some objects, and the channel it listens on."""

    def __init__(self) -> None:
        self.name = f"durand-{next(_names)}"
        durand.set_scheduler(VirtualScheduler())  # no asyncio loop; nothing here waits for its timers
        self.bus = can.Bus(interface="virtual", channel=self.name)
        self.network = durand.CANBusNetwork(self.bus)
        self.node = durand.Node(
            self.network, NODE, capabilities=NodeCapabilities(sdo_servers=2, rpdos=4, tpdos=4)
        )
        self.od = self.node.object_dictionary
        self.od[0x6040] = durand.Variable(DatatypeEnum.UNSIGNED16, "rw", 0)
        self.od[0x6041] = durand.Variable(DatatypeEnum.UNSIGNED16, "rw", 0x0250)
        self.od[0x6060] = durand.Variable(DatatypeEnum.INTEGER8, "rw", 0, minimum=-1, maximum=10)
        self.od[0x6064] = durand.Variable(DatatypeEnum.INTEGER32, "rw", -123456)
        self.od[0x2000] = durand.Variable(DatatypeEnum.REAL32, "rw", 1.5)
        self.od[0x2001] = durand.Variable(DatatypeEnum.UNSIGNED64, "rw", 0x0102030405060708)
        self.od[0x2100] = durand.Variable(DatatypeEnum.DOMAIN, "rw", b"")
        self.od[0x2101] = durand.Variable(DatatypeEnum.UNSIGNED32, "ro", 7)
        self.od[0x2102] = durand.Variable(DatatypeEnum.UNSIGNED32, "wo", 7)

    def close(self) -> None:
        self.network.stop()
        self.bus.shutdown()


@pytest.fixture
def peer() -> Iterator[Peer]:
    peer = Peer()
    yield peer
    peer.close()


@pytest.fixture
def wire(peer: Peer) -> Iterator[Channel]:
    with Channel.open("virtual", peer.name) as channel:
        yield channel


@pytest.fixture
def node(wire: Channel) -> Iterator[CanopenNode]:
    with CanopenNode(wire, NODE, sdo_timeout=PATIENCE) as node:
        yield node
        node.command(NmtCommand.RESET_NODE, timeout=PATIENCE)


# -- SDO


@pytest.mark.parametrize(
    ("index", "data_type", "there", "written"),
    [
        (0x6041, DataType.UNSIGNED16, 0x0250, 0x0637),
        (0x6064, DataType.INTEGER32, -123456, 2147483647),
        (0x2000, DataType.REAL32, 1.5, -0.25),
        (0x2001, DataType.UNSIGNED64, 0x0102030405060708, 2**64 - 1),  # eight bytes: in segments
    ],
)
def test_values_are_read_and_written(peer: Peer, node: CanopenNode, index, data_type, there, written) -> None:
    assert node.sdo.read(index, data_type=data_type) == there
    node.sdo.write(index, 0, written, data_type=data_type)
    assert peer.od.read(index, 0) == written
    node.sdo.write(index, 0, there, data_type=data_type)


@pytest.mark.parametrize(
    ("index", "data", "code"),
    [
        (0x5FFF, None, 0x0602_0000),
        (0x2102, None, 0x0601_0001),
        (0x2101, b"\0\0\0\0", 0x0601_0002),
        (0x6060, b"\x0b", 0x0609_0031),
        (0x6060, b"\xfe", 0x0609_0032),
        (0x6060, b"\x00\x00", 0x0607_0010),
    ],
)
def test_the_refusals_of_the_durand_slave_are_raised_with_their_code(
    node: CanopenNode, index, data, code
) -> None:
    with pytest.raises(SdoAbort) as caught:
        node.sdo.upload(index) if data is None else node.sdo.download(index, 0, data)
    assert caught.value.code == code


@pytest.mark.parametrize("transfer_type", list(SdoTransferType))
@pytest.mark.parametrize("size", [1, 4, 5, 7, 8, 255, 256, 889, 890])
def test_domains_are_transferred_in_both_directions(
    peer: Peer, node: CanopenNode, size: int, transfer_type: SdoTransferType
) -> None:
    node.sdo.download(0x2100, 0, BIG[:size], transfer_type=transfer_type)
    assert peer.od.read(0x2100, 0) == BIG[:size]
    assert node.sdo.upload(0x2100, transfer_type=transfer_type) == BIG[:size]


def test_64_kib_in_blocks_with_their_progress(peer: Peer, node: CanopenNode) -> None:
    seen: list[tuple[int, int | None]] = []
    node.sdo.download(0x2100, 0, BIG, progress=lambda done, all_: seen.append((done, all_)))
    assert peer.od.read(0x2100, 0) == BIG
    assert seen[-1] == (65536, 65536)
    assert seen == sorted(seen)
    assert 70 < len(seen) < 90  # once for each block of 889 bytes
    seen.clear()
    assert node.sdo.upload(0x2100, progress=lambda done, all_: seen.append((done, all_))) == BIG
    assert seen[-1] == (65536, 65536)


def test_a_second_channel_beside_the_first(peer: Peer, node: CanopenNode) -> None:
    for subindex, identifier in ((1, 0x640), (2, 0x5C0)):
        node.sdo.download(0x1201, subindex, identifier.to_bytes(4, "little"))
    second = SdoClient(node.channel, NODE, cob_ids=(0x640, 0x5C0))
    try:
        assert second.read(0x6041, data_type=DataType.UNSIGNED16) == 0x0250
        assert node.sdo.read(0x6064, data_type=DataType.INTEGER32) == -123456
    finally:
        second.close()
        node.sdo.download(0x1201, 1, (1 << 31 | 0x640).to_bytes(4, "little"))


# -- NMT


def test_nmt_commands_are_followed_and_confirmed(peer: Peer, node: CanopenNode) -> None:
    assert node.command(NmtCommand.START) is Confirmation.SDO
    assert peer.node.nmt.state == 5
    assert node.command(NmtCommand.STOP) is Confirmation.SDO
    assert peer.node.nmt.state == 4
    assert node.command(NmtCommand.RESET_COMMUNICATION, timeout=PATIENCE) is Confirmation.BOOT_UP
    assert peer.node.nmt.state == 127


def test_the_heartbeat_of_the_durand_slave_is_received(peer: Peer, node: CanopenNode) -> None:
    node.sdo.write(0x1017, 0, 500)
    eventually(lambda: node.nmt.has_heartbeat)
    assert node.nmt.state is NmtState.PRE_OPERATIONAL
    node.sdo.write(0x1017, 0, 0)


# -- PDO


def test_an_rpdo_that_we_mapped_sets_its_objects(peer: Peer, node: CanopenNode, wire: Channel) -> None:
    mapping = (MappedObject(0x6040, 0, 16), MappedObject(0x6064, 0, 32))
    pdo = set_pdo(node.sdo, True, 1, mapping=mapping, transmission_type=255)
    assert pdo.mapping == mapping
    node.command(NmtCommand.START)
    wire.send(pdo.cob_id, struct.pack("<Hi", 0x000F, -5))
    eventually(lambda: peer.od.read(0x6064, 0) == -5)
    assert peer.od.read(0x6040, 0) == 0x000F
    peer.od.write(0x6064, 0, -123456)


def test_a_tpdo_that_the_master_mapped_is_sent_on_change(
    peer: Peer, node: CanopenNode, wire: Channel
) -> None:
    mapping = (MappedObject(0x6041, 0, 16), MappedObject(0x6064, 0, 32))
    pdo = set_pdo(node.sdo, False, 1, mapping=mapping, transmission_type=255)
    came: list[bytes] = []
    wire.subscribe(pdo.cob_id, lambda data, _: came.append(data))
    node.command(NmtCommand.START)
    eventually(lambda: came)
    assert came[-1] == struct.pack("<Hi", 0x0250, -123456)
    peer.od.write(0x6041, 0, 0x0637)
    eventually(lambda: came[-1] == struct.pack("<Hi", 0x0637, -123456))
    peer.od.write(0x6041, 0, 0x0250)


def test_a_synchronous_tpdo_is_sent_with_sync(peer: Peer, node: CanopenNode, wire: Channel) -> None:
    pdo = set_pdo(node.sdo, False, 2, mapping=(MappedObject(0x6041, 0, 16),), transmission_type=1)
    assert pdo.synchronous
    came: list[bytes] = []
    wire.subscribe(pdo.cob_id, lambda data, _: came.append(data))
    node.command(NmtCommand.START)
    assert came == []
    wire.send(0x80, b"")
    eventually(lambda: came)
    assert came == [b"\x50\x02"]
