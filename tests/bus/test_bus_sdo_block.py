"""The SDO client with many bytes: in blocks over a channel, abandoned, cut short, and together with a second channel."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable, Iterable, Iterator

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.sdo import SdoTransferType
from axisbus.clock import SystemClock
from axisbus.eds.model import Eds, Number, Object, ObjectType, Variable
from axisbus.errors import Interrupted, SdoError, SdoTimeout
from axisbus.sim.device import Device
from axisbus.sim.node.slave import Slave
from kit.bus.fake_bus import FakeBus, Frame

NODE = 5
FILE = 0x2100
DATA = random.Random(7).randbytes(3000)
GENERAL_ABORT = "8000210000000008"

ROWS = [
    (0x1000, 0, DataType.UNSIGNED32, "ro", 0x00020192),
    (0x1001, 0, DataType.UNSIGNED8, "ro", 0),
    (0x1200, 0, DataType.UNSIGNED8, "ro", 2),
    (0x1201, 0, DataType.UNSIGNED8, "ro", 3),
    (0x1201, 1, DataType.UNSIGNED32, "rw", 1 << 31),
    (0x1201, 2, DataType.UNSIGNED32, "rw", 1 << 31),
    (0x1201, 3, DataType.UNSIGNED8, "rw", 0),
    (0x1280, 0, DataType.UNSIGNED8, "ro", 3),
    (0x1280, 1, DataType.UNSIGNED32, "rw", 0x605),
    (0x1280, 2, DataType.UNSIGNED32, "rw", 0x585),
    (0x1280, 3, DataType.UNSIGNED8, "rw", 9),
    (0x6040, 0, DataType.UNSIGNED16, "rw", 0),
    (0x2000, 0, DataType.UNSIGNED16, "rw", 0x1234),
    (FILE, 0, DataType.DOMAIN, "rw", None),
]


def device() -> Device:
    objects: dict[int, dict[int, Variable]] = {}
    for index, sub, kind, access, default in ROWS:
        value = None if default is None else Number(default)
        objects.setdefault(index, {})[sub] = Variable(index, sub, f"{index:04X}", kind, access, value)
    made = {
        index: Object(index, f"{index:04X}", ObjectType.RECORD if len(subs) > 1 else ObjectType.VAR, subs)
        for index, subs in objects.items()
    }
    return Device(Eds("by hand", made, {}), NODE)


class SimulatedNode:
    """A simulated drive on the fake bus that answers at once."""

    def __init__(self, fake: FakeBus) -> None:
        self.device = device()
        self.slave = Slave(self.device)
        self.slave.step(0.0)
        self.slave.step(1.0)
        self.slave.take_frames()
        fake.peers.append(self)

    def __call__(self, can_id: int, data: bytes, remote: bool) -> Iterable[Frame]:
        self.slave.on_frame(can_id, data, 1.0, remote=remote)
        return self.slave.take_frames()

    @property
    def content(self) -> object:
        return self.device.dictionary.values[FILE << 8]


@pytest.fixture
def simulated_node(fake: FakeBus) -> SimulatedNode:
    return SimulatedNode(fake)


@pytest.fixture
def sdo(channel: Channel, simulated_node: SimulatedNode) -> SdoClient:
    return SdoClient(channel, NODE, timeout=5.0)


@pytest.fixture
def hasty(channel: Channel, simulated_node: SimulatedNode) -> SdoClient:
    return SdoClient(channel, NODE, timeout=0.25, tries=5)


def asked(fake: FakeBus) -> list[str]:
    """The initiated transfers on 2100h: the command bytes."""
    return [data[:1].hex() for data in fake.frames(0x605) if data[1:4] == b"\x00\x21\x00" and data[0] != 0x80]


def test_many_bytes_are_transferred_in_blocks_and_few_are_not(
    sdo: SdoClient, fake: FakeBus, simulated_node: SimulatedNode
) -> None:
    sdo.download(FILE, 0, DATA)
    assert simulated_node.content == DATA
    assert sdo.upload(FILE) == DATA
    assert asked(fake) == ["c6", "40", "a4"]
    fake.sent.clear()
    sdo.download(FILE, 0, DATA[:255])
    assert sdo.upload(FILE) == DATA[:255]
    assert asked(fake) == ["21", "40"]


class Pausing(SystemClock):
    """The clock of a channel that calls ``pause`` where a transfer pauses between two frames."""

    def __init__(self, pause: Callable[[], object]) -> None:
        self._pause = pause

    def sleep(self, seconds: float) -> None:
        self._pause()


@pytest.mark.parametrize(("segments", "pauses"), [(1, []), (4, []), (5, [4]), (8, [4]), (9, [4, 8])])
def test_segments_leave_in_groups_of_four_with_room_for_the_scan_s_frames_between(
    channel: Channel,
    sdo: SdoClient,
    fake: FakeBus,
    simulated_node: SimulatedNode,
    segments: int,
    pauses: list[int],
) -> None:
    seen: list[int] = []
    channel.clock = Pausing(lambda: seen.append(len(fake.frames(0x605)) - 1))  # less the one that begins
    data = DATA[: 7 * segments]
    sdo.download(FILE, 0, data, transfer_type=SdoTransferType.BLOCK)
    assert simulated_node.content == data
    assert seen == pauses


def test_a_transfer_that_is_not_wanted_any_more_ends_between_two_groups(
    channel: Channel, sdo: SdoClient, fake: FakeBus, simulated_node: SimulatedNode
) -> None:
    channel.clock = Pausing(sdo.cancel)
    with pytest.raises(Interrupted):
        sdo.download(FILE, 0, DATA, transfer_type=SdoTransferType.BLOCK)
    assert len(fake.frames(0x605)) == 1 + 4 + 1
    assert fake.frames(0x605)[-1].hex() == GENERAL_ABORT


def test_block_transfers_are_tried_once_with_a_node_that_does_not_support_them(
    sdo: SdoClient, fake: FakeBus, simulated_node: SimulatedNode
) -> None:
    simulated_node.device.dials.sdo_block = False
    for _ in range(2):
        sdo.download(FILE, 0, DATA)
        assert sdo.upload(FILE) == DATA
    assert asked(fake) == ["c6", "21", "40", "21", "40"]


@pytest.mark.parametrize(
    ("transfer_type", "lost"),
    [
        (SdoTransferType.NORMAL, 1),
        (SdoTransferType.NORMAL, 60),
        (SdoTransferType.BLOCK, 2),
        (SdoTransferType.BLOCK, 3),
        (SdoTransferType.BLOCK, 129),
        (SdoTransferType.BLOCK, 130),
    ],
)
def test_a_lost_frame_costs_time_and_nothing_else(
    hasty: SdoClient, simulated_node: SimulatedNode, transfer_type: SdoTransferType, lost: int
) -> None:
    dials = simulated_node.device.dials
    dials.sdo_lost = {lost}
    hasty.download(FILE, 0, DATA, transfer_type=transfer_type)
    assert simulated_node.content == DATA
    assert dials.sdo_frames > lost
    dials.sdo_frames = 0
    assert hasty.upload(FILE, transfer_type=transfer_type) == DATA


def test_a_node_that_falls_silent_in_a_block_is_a_time_out(
    hasty: SdoClient, simulated_node: SimulatedNode
) -> None:
    simulated_node.device.dials.sdo_lost = set(range(100, 100_000))
    with pytest.raises(SdoTimeout, match="2100h:00"):
        hasty.download(FILE, 0, DATA)
    assert simulated_node.content == b""


def test_a_server_that_never_confirms_a_segment_is_an_sdo_error(channel: Channel, fake: FakeBus) -> None:
    answers = {0xC6: "a40021007f000000", 0x40: "4300100092010200"}

    def peer(can_id: int, data: bytes, _: bool) -> list[Frame]:
        last = (data[0] & 0x80 and data[0] not in (0x80, 0xC6)) or data[0] == 0x7F
        answer = "a2007f0000000000" if last else answers.get(data[0])
        return [(0x585, bytes.fromhex(answer))] if can_id == 0x605 and answer else []

    fake.peers.append(peer)
    client = SdoClient(channel, NODE, timeout=5.0, tries=1)
    with pytest.raises(SdoError, match="failed in 1 attempt") as caught:
        client.download(FILE, 0, DATA, transfer_type=SdoTransferType.BLOCK)
    assert "without any received segment" in caught.value.observed
    assert fake.frames(0x605)[-1].hex() == "8000210003000405"


def test_cancel_in_a_block_aborts_it_at_the_node_and_the_next_transfer_is_correct(
    sdo: SdoClient, fake: FakeBus, simulated_node: SimulatedNode
) -> None:
    with pytest.raises(Interrupted):
        sdo.download(FILE, 0, DATA, progress=lambda _done, _all: sdo.cancel())
    assert fake.frames(0x605)[-1].hex() == GENERAL_ABORT
    assert simulated_node.content == b""
    assert sdo.read(0x2000) == 0x1234


def test_an_urgent_write_is_sent_before_the_rest_of_a_block(
    sdo: SdoClient, fake: FakeBus, simulated_node: SimulatedNode
) -> None:
    """A quick stop of a drive without a mapped controlword, while its firmware is written."""
    urgent = threading.Thread(target=lambda: sdo.download_urgent(0x6040, 0, b"\x02\x00"))

    def stop(_done: int, _all: int | None) -> None:
        if urgent.ident is None:
            urgent.start()

    with pytest.raises(Interrupted):
        sdo.download(FILE, 0, DATA * 20, progress=stop)
    urgent.join(5)
    assert simulated_node.device.dictionary.values[0x6040 << 8] == 0x02
    sent = [frame.hex() for frame in fake.frames(0x605)]
    assert sent.index("2b40600002000000") == sent.index(GENERAL_ABORT) + 1


def test_progress_counts_bytes(sdo: SdoClient) -> None:
    seen: list[tuple[int, int | None]] = []
    sdo.download(FILE, 0, DATA, progress=lambda done, all_: seen.append((done, all_)))
    assert seen == [(0, 3000), (889, 3000), (1778, 3000), (2667, 3000), (3000, 3000)]
    seen.clear()
    sdo.upload(
        FILE, transfer_type=SdoTransferType.NORMAL, progress=lambda done, all_: seen.append((done, all_))
    )
    assert seen[:3] == [(0, 3000), (7, 3000), (14, 3000)]
    assert seen[-1] == (3000, 3000)


# -- additional channels


@pytest.fixture
def second(channel: Channel, sdo: SdoClient) -> Iterator[SdoClient]:
    """A client on the node's second SDO channel, which is given its identifiers."""
    for subindex, identifier in ((1, 0x655), (2, 0x5D5)):
        sdo.download(0x1201, subindex, identifier.to_bytes(4, "little"))
    client = SdoClient(channel, NODE, timeout=5.0, cob_ids=(0x655, 0x5D5))
    yield client
    client.close()


def test_an_additional_channel_is_used(
    second: SdoClient, fake: FakeBus, simulated_node: SimulatedNode
) -> None:
    second.download(FILE, 0, DATA)
    assert simulated_node.content == DATA
    assert second.read(0x2000, data_type=DataType.UNSIGNED16) == 0x1234
    assert fake.frames(0x655)[0].hex() == "c6002100b80b0000"


def test_concurrent_transfers_on_both_channels_do_not_mix(sdo: SdoClient, second: SdoClient) -> None:
    sdo.download(FILE, 0, DATA)
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.extend(second.upload(FILE) for _ in range(5)))
    reader.start()
    mine = [sdo.upload(FILE) for _ in range(5)]
    reader.join(20)
    assert mine == got == [DATA] * 5
