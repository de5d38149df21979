"""A bus served by the protocol of socketcand: python-can's own client as the other side, and clients that are none."""

from __future__ import annotations

import logging
import socket
import time
from contextlib import suppress

import can
import pytest
from can.interfaces.socketcand.socketcand import SocketCanDaemonBus

from axisbus.bus.link.adapter import open_adapter
from axisbus.errors import AdapterError
from axisbus.sim import socketcand_server as serving
from axisbus.sim.socketcand_protocol import GREETING, Dialogue, Frame, frame_text
from axisbus.sim.socketcand_server import LOOPBACK, Server

OPEN, RAW = b"< open sim >", b"< rawmode >"


# -- messages --------------------------------------------------------------------------------------------------------------------


def raw() -> Dialogue:
    dialogue = Dialogue("sim")
    assert dialogue.take(OPEN)[0] == b"< ok >"
    assert dialogue.take(RAW)[0] == b"< ok >"
    assert dialogue.raw
    return dialogue


def test_a_client_opens_the_bus_asks_for_raw_mode_and_sends():
    assert GREETING == b"< hi >"
    dialogue = raw()
    sent = b"< send 601 8 40 0 10 0 0 0 0 0 >< send 080 0  >< send 00000123 1 ff >"
    answers, frames = dialogue.take(sent)
    assert answers == b""
    assert frames == [
        Frame(0x601, bytes.fromhex("4000100000000000")), Frame(0x80, b""), Frame(0x123, b"\xff", extended=True),
    ]  # fmt: skip


@pytest.mark.parametrize("size", [1, 2, 7, 40])
def test_messages_are_read_in_pieces(size):
    dialogue, frames, data = raw(), [], b"< send 181 2 1 2 >" * 3 + b"\r\n< send 182 1 9 >"
    for start in range(0, len(data), size):
        frames += dialogue.take(data[start : start + size])[1]
    assert [frame.can_id for frame in frames] == [0x181] * 3 + [0x182]


@pytest.mark.parametrize(
    "sent",
    [b"< send 800 0 >", b"< send 181 9 1 2 3 4 5 6 7 8 9 >", b"< send 181 2 1 >", b"< send xyz 1 1 >", b"< send >",
     b"< send 181 1 100 >", b"< send 20000000 0 >", b"< send -1 0 >"],
)  # fmt: skip
def test_an_invalid_frame_is_refused(sent):
    assert raw().take(sent) == (b"< error no frame >", [])


def test_only_the_bus_that_there_is_is_opened_and_only_raw_mode_served():
    dialogue = Dialogue("sim")
    for sent in (RAW, b"< open can0 >", b"< send 181 1 1 >", b"< >"):
        answers, frames = dialogue.take(sent)
        assert answers.startswith(b"< error this bus is opened by < open sim >")
        assert frames == []
    assert not dialogue.raw
    assert dialogue.take(OPEN)[0] == b"< ok >"
    assert dialogue.take(b"< bcmmode >")[0].startswith(b"< error")
    assert dialogue.take(b"< echo >")[0] == b"< echo >"


def test_a_client_of_another_protocol_is_recognised():
    dialogue = Dialogue("sim")
    dialogue.take(b"GET / HTTP/1.1\r\n" * 30)
    assert dialogue.is_overlong


def test_a_frame_is_written_as_the_protocol_defines():
    assert frame_text(Frame(0x81, b"\x01\xab"), 12.5) == b"< frame 081 12.500000 01AB >"
    assert frame_text(Frame(0x1ABCDEF0, b"", extended=True), 1.0) == b"< frame 1ABCDEF0 1.000000  >"


# -- a server --------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def server():
    made = Server(0)
    yield made
    made.bus.shutdown()


def joined(server, **options):
    bus = open_adapter("socketcand", server.channel, None, {"host": LOOPBACK, "port": server.port, **options})
    time.sleep(0.1)  # nothing is sent for 50 ms
    return bus


def test_frames_reach_the_simulated_drives_and_all_clients_but_their_sender(server):
    one, other = joined(server), SocketCanDaemonBus(server.channel, LOOPBACK, server.port)
    time.sleep(0.1)
    try:
        one.send(can.Message(arbitration_id=0x201, data=b"\x0f\x00", is_extended_id=False))
        for far in (server.bus, other):
            heard = far.recv(2.0)
            assert (heard.arbitration_id, bytes(heard.data), heard.is_extended_id) == (
                0x201,
                b"\x0f\x00",
                False,
            )
        server.bus.send(can.Message(arbitration_id=0x12345678, data=b"", is_extended_id=True))
        for far in (one, other):
            heard = far.recv(2.0)
            assert (heard.arbitration_id, bytes(heard.data), heard.is_extended_id) == (0x12345678, b"", True)
        assert one.recv(0.1) is None
    finally:
        one.shutdown()
        other.shutdown()


def test_a_frame_takes_no_longer_than_the_loopback(server):
    """Without quick acknowledgements every second frame would wait 40 ms, with python-can's own options too."""
    one = SocketCanDaemonBus(server.channel, LOOPBACK, server.port)
    time.sleep(0.1)
    took = []
    for number in range(50):
        begin = time.perf_counter()
        one.send(can.Message(arbitration_id=0x201, data=bytes([number]), is_extended_id=False))
        assert server.bus.recv(2.0) is not None
        server.bus.send(can.Message(arbitration_id=0x181, data=bytes([number]), is_extended_id=False))
        assert one.recv(2.0).data[0] == number
        took.append(time.perf_counter() - begin)
    one.shutdown()
    assert sorted(took)[25] < 0.01


@pytest.mark.parametrize("at_once", [True, False], ids=["", "as on Windows"])
def test_a_client_that_does_not_read_or_sends_nonsense_is_disconnected_without_a_delay(
    server, caplog, at_once, monkeypatch
):
    caplog.set_level(logging.CRITICAL)
    if not at_once:
        monkeypatch.setattr(serving, "_AT_ONCE", None)
    good = joined(server)
    deaf = socket.create_connection((LOOPBACK, server.port))
    deaf.sendall(f"< open {server.channel} >< rawmode >".encode())
    mad = socket.create_connection((LOOPBACK, server.port))
    mad.sendall(b"\x00\xff<" * 500)
    time.sleep(0.2)
    assert server.clients == 2
    begin = time.monotonic()
    for number in range(200_000):
        server.bus.send(can.Message(arbitration_id=0x181, data=bytes(8), is_extended_id=False))
        if number % 20 == 0:
            while good.recv(0.0) is not None:
                pass
        if server.clients == 1:
            break
    assert server.clients == 1
    assert time.monotonic() - begin < 40.0
    while good.recv(0.0) is not None:
        pass
    server.bus.send(can.Message(arbitration_id=0x182, data=b"", is_extended_id=False))
    assert good.recv(2.0).arbitration_id == 0x182
    for each in (deaf, mad):
        each.close()
    good.shutdown()


def test_a_client_that_sends_too_much_waits_and_one_that_is_not_served_is_disconnected(server):
    flood = socket.create_connection((LOOPBACK, server.port))
    flood.sendall(f"< open {server.channel} >< rawmode >".encode())
    flood.settimeout(0.3)
    frames = b"< send 201 8 0 0 0 0 0 0 0 0 >" * 1000
    with suppress(TimeoutError, ConnectionError):
        for _ in range(1000):
            flood.sendall(frames)
    assert server.bus.received.qsize() <= 1024
    until = time.monotonic() + 5.0
    while server.clients and time.monotonic() < until:
        time.sleep(0.01)
    assert server.clients == 0
    while server.bus.recv(0.0) is not None:
        pass
    good = joined(server)
    good.send(can.Message(arbitration_id=0x202, data=b"", is_extended_id=False))
    heard = server.bus.recv(2.0)
    while heard.arbitration_id == 0x201:  # frames in transit when the flood ended
        heard = server.bus.recv(2.0)
    assert heard.arbitration_id == 0x202
    flood.close()
    good.shutdown()


def test_a_crowd_is_kept_out(server):
    crowd = [socket.create_connection((LOOPBACK, server.port)) for _ in range(60)]
    time.sleep(0.3)
    assert server.clients == 32
    for each in crowd:
        each.close()
    until = time.monotonic() + 5.0
    while server.clients and time.monotonic() < until:
        time.sleep(0.01)
    assert server.clients == 0
    joined(server).shutdown()


def test_a_port_in_use_is_reported(server):
    with pytest.raises(AdapterError, match="cannot be served") as told_of:
        Server(server.port)
    assert "--port" in told_of.value.remedy


# -- our end ---------------------------------------------------------------------------------------------------------------------


def test_a_message_in_pieces_is_not_logged_and_an_invalid_one_is(server, caplog):
    bus = joined(server, tcp_tune=False)
    end = getattr(bus, "_SocketCanDaemonBus__socket")  # noqa: B009  # python-can has no other name for it
    ours, theirs = socket.socketpair()
    bus._SocketCanDaemonBus__socket = ours
    try:
        for piece in (b"< frame 123 1.0", b" 1122 >", b"nonsense"):
            theirs.sendall(piece)
            bus.recv(0.5)
    finally:
        bus._SocketCanDaemonBus__socket = end
        ours.close()
        theirs.close()
        bus.shutdown()
    assert [record.msg.split(":")[0] for record in caplog.records] == ["Bad data"]


def test_a_missing_server_is_reported_at_once():
    with socket.socket() as free:
        free.bind((LOOPBACK, 0))
        port = free.getsockname()[1]
    begin = time.monotonic()
    with pytest.raises(AdapterError, match="cannot be opened") as told_of:
        open_adapter("socketcand", "sim", None, {"host": LOOPBACK, "port": port})
    assert time.monotonic() - begin < 3.0
    assert "axisbus sim" in told_of.value.remedy


def test_a_server_that_ends_is_reported(server):
    bus = joined(server)
    server.close()
    time.sleep(0.2)
    with pytest.raises(can.CanError, match="closed the connection"):
        bus.recv(0.5)
    with suppress(OSError):
        bus.shutdown()


def test_a_channel_that_is_not_served_is_refused(server):
    with pytest.raises(AdapterError, match="cannot be opened"):
        open_adapter("socketcand", "can0", None, {"host": LOOPBACK, "port": server.port})
