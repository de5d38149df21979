"""The readers of CAN frames and of serial frames, each with valid conversations, for the fuzzer.

A frame of the CAN bus is its identifier (four octets, highest first; the flags of ``linux/can.h`` above it), then its data.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import can

from axisbus.bus.link import controller
from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.plan import PdoChange, PlannedPdo
from axisbus.bus.pdo.tpdo_inputs import TpdoSlot
from axisbus.bus.sdo.client import failed
from axisbus.bus.sync_and_time import SyncConsumer, TimeConsumer
from axisbus.cell import reader as cells
from axisbus.check.bus_load import Meter
from axisbus.cia301.datatypes import DataType, decode
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.emcy import explain
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.master_detection import ExpectedMasters, MasterDetector
from axisbus.cia301.pdo import MappedObject, PdoConfiguration
from axisbus.cia301.sdo import SdoTransferType
from axisbus.cia301.sdo_session import SdoSession, SdoTransferRequest
from axisbus.cia305 import master
from axisbus.cia305.dialogue import AdaptiveLssTimeout, LssReplies, LssReply, LssRequest
from axisbus.cia305.fastscan import FastScan
from axisbus.cia305.services import LssAddress
from axisbus.core.files import load_dictionaries
from axisbus.eds import load
from axisbus.eds.dictionary import DictionaryEntry
from axisbus.errors import LssError, SdoError
from axisbus.machine.bus_monitor import BusMonitor
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.slave import Slave
from axisbus.trace import context, frame_formats
from axisbus.trace.decoder import Decoder
from kit.bus.fake_bus import FakeBus
from kit.command_line import ROOT
from kit.frame_mutations import mutated_frames, packed, unpacked
from kit.lss_line import HandSlave, Line
from kit.reader_limits import MB, Limits, Names, Reader

ID = 5
_EXTENDED, _REMOTE, _ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
_LIMITS = Limits(seconds=1.0, memory=16 * MB)  # of a conversation
Take = Callable[[Sequence[bytes]], object]
Conversations = list[list[bytes]]


def never(_: str, __: Path) -> bool:
    """Reject every error: this reader drops and counts an invalid frame, and raises nothing."""
    return False


def reader_of(
    valid: Callable[[], Conversations],
    take: Take,
    *,
    errors: tuple[type[Exception], ...] = (),
    names: Names = never,
    limits: Limits = _LIMITS,
    holds: Callable[[], Any] | None = None,
) -> Reader:
    """Make a reader whose inputs are conversations: one frame in each line."""
    made = Reader(
        ".frames",
        lambda _: [packed(each) for each in valid()],
        lambda path: take(unpacked(path.read_bytes())),
        mutated_frames,
        errors,
        names,
        limits,
    )
    return made if holds is None else made._replace(holds=holds)


def unshown(_: str, __: Path) -> bool:
    """Ignore every error message: the program handles the error itself, and does not show it."""
    return True


def names_any(*words: str) -> Names:
    """Return a function that looks for one of these words in a message."""
    return lambda message, _: any(word in message for word in words)


def on_bus(can_id: int, data: bytes | str) -> bytes:
    """Return a frame of the bus as a line of an input."""
    return can_id.to_bytes(4, "big") + (bytes.fromhex(data) if isinstance(data, str) else data)


def off_bus(line: bytes) -> CanFrame:
    """Return the frame of a line, with at most 8 data bytes."""
    flags, data = int.from_bytes(line[:4], "big"), line[4:12]
    extended, remote, error = (bool(flags & flag) for flag in (_EXTENDED, _REMOTE, _ERROR))
    can_id = flags & (0x1FFF_FFFF if extended or error else 0x7FF)
    return CanFrame(0.0, can_id, data, extended, remote, error)


# -- SDO -------------------------------------------------------------------------------------------------------------

_REQUESTS = (
    SdoTransferRequest(0x1000, 0, None, 0.5, 3, SdoTransferType.NORMAL, 500),
    SdoTransferRequest(0x1008, 0, None, 0.5, 3, SdoTransferType.NORMAL, 500),
    SdoTransferRequest(0x1008, 0, None, 0.5, 3, SdoTransferType.BLOCK, 500),
    SdoTransferRequest(0x1017, 0, bytes(2), 0.5, 3, SdoTransferType.NORMAL),
    SdoTransferRequest(0x1F50, 1, bytes(range(40)), 0.5, 3, SdoTransferType.NORMAL),
    SdoTransferRequest(0x1F50, 1, bytes(range(40)), 0.5, 3, SdoTransferType.BLOCK),
)
_SILENCES = 60


def _sdo_answers() -> Conversations:
    """Return the answers to each request, behind the number of the request; the last two are typed from CiA 301 7.2.4.3."""
    device = Slave(device_from_eds(load("builtin:gim6010-8"), ID, seed=1))
    now = _booted(device)
    conversations = []
    for number, request in enumerate(_REQUESTS[:4]):
        session, answers = SdoSession(request), [bytes([number])]
        sent = list(session.start())
        while not session.done:
            device.on_frame(0x600 + ID, sent.pop(0), now)
            now += 0.01
            device.step(now)
            for can_id, data in device.take_frames():
                if can_id == 0x580 + ID:
                    answers.append(data)
                    sent += session.receive(data, 0.001)
        assert session.failure is None
        conversations.append(answers)
    segmented = [f"{0x20 | number % 2 << 4:02x}00000000000000" for number in range(6)]
    in_blocks = ["a4501f0104000000", "a204040000000000", "a202040000000000", "a100000000000000"]
    for number, lines in ((4, ["60501f0100000000", *segmented]), (5, in_blocks)):
        conversations.append([bytes([number]), *map(bytes.fromhex, lines)])
    return conversations


def _booted(device: Slave) -> float:
    now = 0.0
    for _ in range(5):
        device.step(now)
        now += 0.5
    device.take_frames()
    return now


def _sdo_client(frames: Sequence[bytes]) -> None:
    first = frames[0][0] if frames and frames[0] else 0
    request = _REQUESTS[first % len(_REQUESTS)]
    session = SdoSession(request)
    sent = session.start()
    for frame in frames[1:]:
        if session.done:
            break
        sent = session.receive(frame[:8], 0.001)
        assert all(len(each) == 8 for each in sent)
    for _ in range(_SILENCES):
        if session.done:
            break
        session.elapse(session.remaining)
    assert session.done, "it goes on asking"
    assert len(session.data) <= request.most
    for kind in DataType:
        decode(session.data, kind)
    if session.failure is not None:
        raise failed(ID, DictionaryEntry(request.index, request.subindex), request, session, "")


# -- a simulated drive -------------------------------------------------------------------------------------------------

_TO_DRIVE: Conversations = [
    [
        on_bus(0x605, "4000100000000000"),
        on_bus(0x605, "4008100000000000"),
        on_bus(0x605, "6000000000000000"),
        on_bus(0x605, "7000000000000000"),
        on_bus(0x605, "2b17100064000000"),
        on_bus(0x605, "a00810000a000000"),
        on_bus(0x605, "a300000000000000"),
        on_bus(0x605, "a2010a0000000000"),
        on_bus(0x605, "a100000000000000"),
        on_bus(0x605, "2300140105020080"),
        on_bus(0x605, "2300140105020000"),
        on_bus(0x605, "2300180185010000"),
        on_bus(0x000, "0105"),
        on_bus(0x080, ""),
        on_bus(0x205, "0600"),
        on_bus(0x205, "0700"),
        on_bus(0x305, "0f0001"),
        on_bus(0x405, "0f0010000000"),
        on_bus(0x705 | _REMOTE, ""),
        on_bus(0x100, "000000000000"),
    ],
    [
        on_bus(0x7E5, "0401000000000000"),
        on_bus(0x7E5, "5e00000000000000"),
        on_bus(0x7E5, "1105000000000000"),
        on_bus(0x7E5, "1700000000000000"),
        on_bus(0x7E5, "1300020000000000"),
        on_bus(0x7E5, "0400000000000000"),
        on_bus(0x7E5, "5100000000800000"),
        on_bus(0x000, "8105"),
        on_bus(0x605, "4000100000000000"),
    ],
    [  # it gets another node-ID, and is still being reset at the end
        on_bus(0x7E5, "0401000000000000"),
        on_bus(0x7E5, "112c000000000000"),
        on_bus(0x7E5, "1700000000000000"),
        on_bus(0x7E5, "0400000000000000"),
        on_bus(0x000, "8105"),
    ],
    [
        on_bus(0x605, "2f60600001000000"),
        on_bus(0x605, "237a600000100000"),
        on_bus(0x605, "2b40600006000000"),
        on_bus(0x605, "2b40600007000000"),
        on_bus(0x605, "2b4060000f000000"),
        on_bus(0x605, "2b4060001f000000"),
        on_bus(0x605, "2310100173617665"),
        on_bus(0x605, "230010000000"),
    ],
]
_DRIVE = load("builtin:generic-cia402")


def _drive(frames: Sequence[bytes]) -> None:
    """Require an answer of the drive after LSS has given it its node-ID back and NMT has reset it."""
    slave = Slave(device_from_eds(_DRIVE, ID, seed=1))
    now = _booted(slave)
    for frame in map(off_bus, frames):
        if not frame.extended and not frame.error:
            slave.on_frame(frame.can_id, frame.data, now, remote=frame.remote)
        now += 0.002
        slave.step(now)
        for can_id, data in slave.take_frames():
            assert 0 <= can_id <= 0x7FF
            assert len(data) <= 8
    for _ in range(4):  # a drive receives nothing during a reset
        now += 0.5
        slave.step(now)
    for request in ("0401", f"11{ID:02x}", "17", "0400"):  # the input may have changed the node-ID
        slave.on_frame(0x7E5, bytes.fromhex(request).ljust(8, b"\0"), now)
        now += 0.01
        slave.step(now)
    slave.on_frame(0, b"\x81\0", now)
    for _ in range(4):
        now += 0.5
        slave.step(now)
    slave.take_frames()
    slave.on_frame(0x600 + ID, bytes.fromhex("4000100000000000"), now)
    for _ in range(4):
        now += 0.1
        slave.step(now)
    assert any(can_id == 0x580 + ID for can_id, _ in slave.take_frames()), "it does not answer any more"


# -- LSS ---------------------------------------------------------------------------------------------------------------

_ADDRESS = LssAddress(0xC0B00, 8, 0x10002, 4711)
_DIALOGUES: tuple[Callable[[AdaptiveLssTimeout], Generator[LssRequest, LssReplies, Any]], ...] = (
    lambda pace: FastScan(pace, most=1).run(),
    lambda pace: master.inquire(pace, _ADDRESS),
    lambda pace: master.set_node_id(pace, _ADDRESS, 5, store=True),
    lambda pace: master.set_bit_rate(pace, [_ADDRESS], 500_000, store=False),
    lambda pace: master.identify(pace, _ADDRESS, _ADDRESS),
)


class _Recorded(Line):
    """A line that records the answer to each request; empty if there was no answer."""

    def __init__(self, *slaves: HandSlave) -> None:
        super().__init__(*slaves)
        self.answers: list[bytes] = []

    def _exchange(self, ask: Any) -> Any:
        heard = super()._exchange(ask)
        if ask.expects is not None:
            self.answers.append(heard.answers[0].data if heard.answers else b"")
        return heard


def _lss_answers() -> Conversations:
    """Return the answers of each dialogue, behind the number of the dialogue."""
    conversations = []
    for number, dialogue in enumerate(_DIALOGUES):
        line = _Recorded(HandSlave(0xC0B00, 8, 0x10002, 4711))
        line.run(dialogue(AdaptiveLssTimeout()))
        conversations.append([bytes([number]), *line.answers])
    return conversations


def _lss_master(frames: Sequence[bytes]) -> object:
    """Run a dialogue against the frames of the input, then against silence."""
    first = frames[0][0] if frames and frames[0] else 0
    dialogue = _DIALOGUES[first % len(_DIALOGUES)](AdaptiveLssTimeout())
    said, asked = iter(frames[1:]), 0
    try:
        ask = next(dialogue)
        while True:
            asked += 1
            assert asked < 20_000, "there is no end to it"
            assert len(ask.frame) == 8
            frame = next(said, b"")[:8] if ask.expects is not None else b""
            fits = bool(frame) and frame[0] == ask.expects
            ask = dialogue.send(LssReplies((LssReply(frame, 0.001),) if fits else ()))
    except StopIteration as end:
        return end.value


# -- listeners of a channel --------------------------------------------------------------------------------------------

_MAPPING = (MappedObject(0x6041, 0, 16), MappedObject(0x6064, 0, 32), MappedObject(0x6061, 0, 8))
_TPDO = PdoConfiguration(1, 0x180 + ID, True, 1, _MAPPING)
_PLANNED = PlannedPdo(
    False, _TPDO, _TPDO, PdoChange.KEEP, ("statusword", "position", "mode"), (False, True, True)
)
_TO_MASTER: Conversations = [
    [
        on_bus(0x705, "00"),
        on_bus(0x705, "7f"),
        on_bus(0x705, "05"),
        on_bus(0x085, "1081010000000000"),
        on_bus(0x085, "0000000000000000"),
        on_bus(0x080, ""),
        on_bus(0x080, "01"),
        on_bus(0x185, "37020001000008"),
        on_bus(0x185, "37020002000008"),
        on_bus(0x285, "3702"),
        on_bus(0x100, "0100000002000000"[:12]),
        on_bus(0x585, "4300100092010200"),
        on_bus(_ERROR | 0x20000004, "0004000000000000"),
        on_bus(_EXTENDED | 0x185, "3702"),
        on_bus(0x705 | _REMOTE, ""),
        on_bus(0x000, "8005"),
        on_bus(0x605, "4000100000000000"),
        on_bus(0x7E4, "4f00000000000000"),
    ]
]


class _Listeners:
    """A channel with all its listeners; this thread delivers the frames."""

    channel: Channel
    node: CanopenNode
    slot: TpdoSlot
    clock: TimeConsumer

    @contextmanager
    def there(self) -> Iterator[None]:
        with ExitStack() as stack:
            self.channel = stack.enter_context(Channel(FakeBus(), "socketcan:fake"))
            self.node = stack.enter_context(CanopenNode(self.channel, ID))
            self.node.nmt.watch(0.3)
            self.feed = self.node.emcy.feed()
            self.slot = TpdoSlot(
                _PLANNED, lambda data, at: self.channel.drops.note(DropReason.SHORT_PDO, ID, at, 0x185, data)
            )
            self.channel.subscribe(self.slot.cob_id, self.slot.on_frame)
            self.sync, self.clock = SyncConsumer(self.channel, 0x80, 0.01), TimeConsumer(self.channel)
            self.signs = MasterDetector(ExpectedMasters(frozenset({1, ID}), frozenset({127})))
            self.now = 0.0
            yield

    def take(self, frames: Sequence[bytes]) -> None:
        for frame in map(off_bus, frames):
            self.now += 0.001
            self.channel._dispatch(_message(frame), self.now)
            self.signs.note(frame)
            if self.channel.failure is not None:
                raise self.channel.failure
        self.slot.read_into({}, self.now)
        for emcy in self.feed.take():
            assert explain(emcy.code)
        assert self.node.nmt.describe(self.now)
        assert all(map(str, self.channel.drops.found))
        assert len(self.channel.drops.found) <= 257


def _message(frame: CanFrame) -> can.Message:
    return can.Message(
        arbitration_id=frame.can_id,
        data=b"" if frame.remote else frame.data,
        is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
        is_error_frame=frame.error,
        check=False,
    )


_LISTENERS = _Listeners()


# -- decoded traffic -----------------------------------------------------------------------------------------------------

_CELL = cells.load(ROOT / "examples" / "cell.toml")
_FILES = load_dictionaries(_CELL)
_KNOWN = context.of_cell(_CELL, _FILES)
_OVERVIEW = BusMonitor(_CELL, _FILES)  # shared by all inputs: making one is slow


def _traffic() -> Conversations:
    both = [
        *_TO_DRIVE[0][:4],
        on_bus(0x585, "4300100092010200"),
        *_TO_MASTER[0],
        *_TO_DRIVE[1],
        *_TO_DRIVE[2],
    ]
    first = [on_bus(int.from_bytes(line[:4], "big") & ~0x7F | 1, line[4:]) for line in both]
    return [both, first]


def _decoded(frames: Sequence[bytes]) -> None:
    decoder, meter = Decoder(_KNOWN), Meter(1_000_000)
    for number, line in enumerate(frames):
        frame = off_bus(line)._replace(time=number * 0.001)
        if frame.error:
            assert controller.describe(frame.can_id, frame.data)
        one = decoder.feed(frame)
        assert "\n" not in frame_formats.line(one)
        frame_formats.plain(one)
        _OVERVIEW.feed(frame, frame.time)
        meter.add(frame, "SDO", None)


OF_FRAMES: dict[str, Reader] = {
    "SDO client": reader_of(
        _sdo_answers, _sdo_client, errors=(SdoError,), names=names_any("1000", "1008", "1017", "1F50")
    ),
    "LSS master": reader_of(_lss_answers, _lss_master, errors=(LssError,), names=names_any("slave", "LSS")),
    "listeners": reader_of(lambda: _TO_MASTER, _LISTENERS.take, holds=_LISTENERS.there),
    "decoder": reader_of(_traffic, _decoded),
    "simulated drive": reader_of(lambda: _TO_DRIVE, _drive),
}
