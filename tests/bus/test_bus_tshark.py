"""Every frame that we send, decoded by an independent decoder: a recorded session, read by tshark's CANopen dissector."""

from __future__ import annotations

import itertools
import json
import shutil
import struct
import subprocess
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime

import can
import pytest

from axisbus.bus.cycle import CanCycle
from axisbus.bus.link.channel import Channel
from axisbus.bus.lss import LssMaster
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.configure import set_pdo
from axisbus.bus.pdo.plan import Policy
from axisbus.bus.sync_and_time import TimeProducer
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia402.port import Outputs
from axisbus.eds import load
from axisbus.errors import SdoAbort
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.node.network import SimulatedNetwork
from kit.bus.fake_bus import eventually
from kit.bus.master import EDS, Master

TSHARK = shutil.which("tshark")
pytestmark = pytest.mark.skipif(TSHARK is None, reason="tshark is not installed (package tshark)")

NODE = 5
LINKTYPE_CAN_SOCKETCAN = 227
_channels = itertools.count()


class Recording(can.Listener):
    """Stores the sent and received frames, in order."""

    def __init__(self) -> None:
        self.messages: list[can.Message] = []
        self.lock = threading.Lock()

    def on_message_received(self, msg: can.Message) -> None:
        with self.lock:
            self.messages.append(msg)

    def of(self, can_id: int) -> list[can.Message]:
        with self.lock:
            return [message for message in self.messages if message.arbitration_id == can_id]

    def stop(self) -> None:
        """Nothing to release."""


@pytest.fixture(scope="module")
def session() -> Iterator[list[can.Message]]:
    """From boot-up to a moving drive and its stop, with everything that a master may send, as a third party receives it."""
    name = f"recorded {next(_channels)}"
    with ExitStack() as stack:
        recording = Recording()
        ear = stack.enter_context(can.Bus(interface="virtual", channel=name))
        notifier = can.Notifier(ear, [recording], timeout=0.05)
        stack.callback(notifier.stop)
        channel = stack.enter_context(Channel.open("virtual", name))
        node = stack.enter_context(CanopenNode(channel, NODE, load(EDS)))
        device = device_from_eds(load(EDS), NODE)
        device.dials.rtr = True
        stack.enter_context(SimulatedNetwork(name, [device]))
        node.nmt.wait_bootup(5.0)
        play(channel, node, device)
        eventually(lambda: any(bytes(message.data) == b"\x02\x05" for message in recording.of(0x000)))
        yield list(recording.messages)


def play(channel: Channel, node: CanopenNode, device: Device) -> None:
    LssMaster(channel).inquire(None)
    node.identity()  # expedited and segmented uploads
    with pytest.raises(SdoAbort):
        node.sdo.upload(0x5FFF)
    node.sdo.write(0x1017, 0, 50)
    node.sdo.write(0x6083, 0, 123_456)
    node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
    set_pdo(node.sdo, False, 4, transmission_type=253, rtr=True)
    policy = Policy(fixed=frozenset({(False, 4)}), requests={4: 0.05}, remap=False)
    master = Master(channel, [node], policy)
    moment = datetime(2000, 1, 1, 12, tzinfo=UTC)
    master.cycle = CanCycle(
        channel,
        master.ports,
        sync_counter=10,
        master_id=127,
        heartbeat=0.02,
        time_producer=TimeProducer(channel, 0.02, wall_clock=lambda: moment),
        guarded={node.nmt: 0.05},
    )
    for word, wanted in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        master.until(wanted, 0x6F, Outputs(controlword=word, mode=1, target_position=-1000))
    channel.send_remote(0x485, 6)
    master.cycle.quick_stop_all()
    device.drive.fault(0x2310)
    eventually(lambda: node.emcy.history)
    node.command(NmtCommand.STOP)


@pytest.fixture(scope="module")
def decoded(session: list[can.Message], tmp_path_factory: pytest.TempPathFactory) -> Layers:
    """The layers that tshark decodes in every frame."""
    path = tmp_path_factory.mktemp("recording") / "session.pcap"
    path.write_bytes(pcap(session))
    command = [str(TSHARK), "-r", str(path), "-d", "can.subdissector,canopen", "-T", "json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return [each["_source"]["layers"] for each in json.loads(done.stdout)]


def pcap(messages: list[can.Message]) -> bytes:
    """Return a capture file of SocketCAN frames (identifier and flags in network byte order)."""
    parts = [struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, LINKTYPE_CAN_SOCKETCAN)]
    for number, message in enumerate(messages):
        identifier = message.arbitration_id | (1 << 30 if message.is_remote_frame else 0)
        data = b"" if message.is_remote_frame else bytes(message.data)
        frame = struct.pack(">IBBBB", identifier, message.dlc, 0, 0, 0) + data
        parts.append(
            struct.pack("<IIII", number // 1000, number % 1000 * 1000, len(frame), len(frame)) + frame
        )
    return b"".join(parts)


Layers = list[dict[str, dict[str, object]]]


def kinds(decoded: Layers) -> set[str]:
    return {
        key.removeprefix("Type: ")
        for each in decoded
        for key in each.get("canopen", {})
        if key.startswith("Type: ")
    }


def test_every_frame_is_decoded_without_complaint(session: list[can.Message], decoded: Layers) -> None:
    """The dissector leaves remote frames to the layer below, which names them."""
    assert len(decoded) == len(session)
    for message, layers in zip(session, decoded, strict=True):
        assert ("canopen" in layers) is not message.is_remote_frame, (message, layers)
        text = json.dumps(layers)
        assert "_ws.malformed" not in text, (message, text)
        assert "_ws.expert" not in text, (message, text)


def test_every_service_of_the_master_was_among_them(session: list[can.Message], decoded: Layers) -> None:
    expected = {
        "NMT",
        "SYNC",
        "TIME STAMP",
        "EMCY",
        "PDO1 (tx)",
        "PDO1 (rx)",
        "Default-SDO (rx)",
        "NMT Error Control",
    }
    assert expected <= kinds(decoded)
    assert any("LSS" in kind for kind in kinds(decoded))
    assert {message.arbitration_id for message in session if message.is_remote_frame} == {0x485, 0x705}


def of(decoded: Layers, kind: str) -> list[dict[str, object]]:
    found = [each["canopen"].get(f"Type: {kind}") for each in decoded if "canopen" in each]
    return [each for each in found if isinstance(each, dict)]


def test_the_decoder_reads_the_sent_values(decoded: Layers) -> None:
    counters = [int(str(each["canopen.sync.counter"])) for each in of(decoded, "SYNC")]
    assert counters == [number % 10 + 1 for number in range(len(counters))]
    times = {str(each["canopen.time_stamp"]) for each in of(decoded, "TIME STAMP")}
    assert times == {"Jan  1, 2000 12:00:00.000000000 UTC"}
    targets = [str(each["canopen.pdo.data.bytes"]) for each in of(decoded, "PDO1 (rx)")]
    assert targets[0] == "06:00:01:18:fc:ff:ff"  # shutdown, profile position, -1000
    assert targets[-1] == "02:00:01:18:fc:ff:ff"  # the quick stop, with the last target
    commands = [str(each["canopen.nmt_ctrl.cd"]) for each in of(decoded, "NMT")]
    assert commands[-2:] == ["0x01", "0x02"]
    (emergency,) = [each for each in of(decoded, "EMCY") if "0x2310" in json.dumps(each).lower()]
    assert "canopen.em.err_code" in json.dumps(emergency)
