"""One frame in transit: the bytes of Linux's SocketCAN, a message for another adapter, and between two processes."""

from __future__ import annotations

import errno
import gc
import select
import socket
import threading
import time
from types import SimpleNamespace

import can
import pytest

from axisbus.bus.link.raw_sockets import PythonCanTransmitter, SocketCanTransmitter, transmitter_of
from axisbus.bus.link.socketpair_bus import PairBus
from axisbus.core.process.launch import can_line


@pytest.fixture
def ends():
    pair = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    yield pair
    for end in pair:
        end.close()


class SocketcanBus:
    """As python-can's: it has a socket."""

    def __init__(self, raw: object) -> None:
        self.socket = raw


class OtherBus(SocketcanBus):
    """Some adapter over a network, which has a socket, too."""


def test_a_frame_is_the_struct_can_frame_of_linux(ends):
    line = SocketCanTransmitter(ends[0])
    line.send(0x205, b"\1\2\3")
    line.send(0x1234_5678, bytes(8))
    line.send(0x7FF, b"")
    line.send_remote(0x185, 6)
    assert [ends[1].recv(100).hex() for _ in range(4)] == [
        "05020000030000000102030000000000",
        "78563492080000000000000000000000",  # bit 31: 29 bits of identifier
        "ff070000000000000000000000000000",
        "85010040060000000000000000000000",  # bit 30: remote
    ]


def test_a_full_queue_is_refused_at_once_and_may_be_tried_again(ends):
    line = SocketCanTransmitter(ends[0])

    def fill() -> None:
        for _ in range(100_000):
            line.send(0x205, bytes(8))

    with pytest.raises(can.CanOperationError) as refused:
        fill()
    assert refused.value.error_code == errno.EAGAIN
    ends[1].recv(100)
    line.send(0x205, bytes(8))


def test_a_closed_socket_raises_the_error_of_python_can():
    line = SocketCanTransmitter(_closed())
    with pytest.raises(can.CanOperationError, match="Failed to transmit") as gone:
        line.send(0x205, b"")
    assert gone.value.error_code == errno.EBADF


def _closed() -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    made.close()
    return made


def test_only_the_socketcan_bus_of_python_can_is_bypassed(ends):
    assert isinstance(transmitter_of(SocketcanBus(ends[0]), None), SocketCanTransmitter)
    assert isinstance(transmitter_of(SocketcanBus("no socket"), None), PythonCanTransmitter)
    assert isinstance(transmitter_of(OtherBus(ends[0]), None), PythonCanTransmitter)


@pytest.mark.parametrize(("can_id", "extended"), [(0x205, False), (0x7FF, False), (0x800, True)])
def test_any_other_adapter_gets_a_message_and_its_time(can_id, extended):
    given = []

    class Bus:
        def send(self, message, timeout) -> None:
            given.append((message, timeout))

    line = PythonCanTransmitter(Bus(), 0.05)
    line.send(can_id, b"\7")
    line.send_remote(can_id, 4)
    (data, first), (remote, second) = given
    assert (first, second) == (0.05, 0.05)
    assert (data.arbitration_id, data.is_extended_id, bytes(data.data)) == (can_id, extended, b"\7")
    assert (remote.arbitration_id, remote.is_extended_id, remote.is_remote_frame, remote.dlc) == (
        can_id,
        extended,
        True,
        4,
    )


@pytest.fixture
def pair():
    """Both ends of a line between two processes: a program's, and that of its simulated drives."""
    one, other = can_line()
    buses = PairBus(one), PairBus(other, of_drives=True)
    yield buses
    for bus in buses:
        bus.shutdown()


@pytest.mark.parametrize(
    ("can_id", "extended", "remote", "data"),
    [
        (0x205, False, False, b"\1\2\3"),
        (0x204, False, False, b"\4"),
        (0x7FF, False, False, b""),
        (0x123, True, False, bytes(8)),  # a low number does not make it a frame of 11 bits
        (0x1FFF_FFFF, True, False, b"\7"),
        (0x705, False, True, b""),
        (0x1234_5678, True, True, b""),
    ],
)
def test_a_frame_arrives_unchanged_at_the_other_end(pair, can_id, extended, remote, data):
    sent = can.Message(
        arbitration_id=can_id,
        is_extended_id=extended,
        is_remote_frame=remote,
        dlc=6 if remote else len(data),
        data=None if remote else data,
    )
    for sender, receiver in (pair, reversed(pair)):
        sender.send(sent)
        assert receiver.recv(1.0).equals(sent, timestamp_delta=None)
        assert receiver.recv(0.0) is None


def test_a_closed_line_raises_in_the_program_and_the_drives_continue(pair):
    program, drives = pair
    drives.socket.shutdown(socket.SHUT_RDWR)
    with pytest.raises(can.CanOperationError, match="the other end of the line has closed"):
        program.recv(1.0)
    with pytest.raises(can.CanOperationError, match="Failed to transmit"):
        program.send(can.Message(arbitration_id=0x205))
    assert not program.alone
    assert drives.recv(0.0) is None
    assert drives.alone
    drives.send(can.Message(arbitration_id=0x185))
    assert drives.recv(0.0) is None


def test_a_program_can_see_if_its_drives_have_taken_its_frames(pair):
    program, drives = pair
    assert not program.behind()
    for _ in range(2):
        program.send(can.Message(arbitration_id=0x80))
    assert program.behind()
    drives.recv(1.0)
    assert program.behind()
    drives.recv(1.0)
    assert not program.behind()
    drives.send(can.Message(arbitration_id=0x185))  # frames for the program are not counted
    assert not program.behind()
    program.send(can.Message(arbitration_id=0x80))
    program.shutdown()
    assert not program.behind()


def test_an_idle_line_keeps_no_process_busy(pair):
    """Otherwise drives without a program, or a receive thread, would use a whole processor."""
    program, drives = pair
    assert _wait(program, 0.03) > 0.025
    program.shutdown()
    assert drives.recv(0.0) is None
    assert drives.alone
    assert _wait(drives, 0.03) > 0.025
    assert 0.045 < _wait(drives, None) < 1.0


def _wait(bus: PairBus, timeout: float | None) -> float:
    """How long a single look takes that finds nothing."""
    begin = time.monotonic()
    assert bus._recv_internal(timeout)[0] is None
    return time.monotonic() - begin


def test_a_full_line_is_an_error_for_a_program_at_once_and_costs_drives_their_frames(pair):
    program, drives = pair
    refused = []

    def fill(bus: PairBus) -> None:
        try:
            for _ in range(10_000):
                bus.send(can.Message(arbitration_id=0x205, data=bytes(8)))
        except can.CanOperationError as error:
            refused.append(error)

    for bus in pair:
        thread = threading.Thread(target=fill, args=(bus,), daemon=True)
        thread.start()
        thread.join(10.0)
        assert not thread.is_alive()
    assert [error.error_code for error in refused] == [errno.EAGAIN]
    while drives.recv(0.0) is not None:
        pass
    program.send(can.Message(arbitration_id=0x206))
    assert drives.recv(0.0).arbitration_id == 0x206


def test_a_frame_that_was_announced_but_cannot_be_read_is_ignored(pair):
    program, _ = pair
    program._poll = SimpleNamespace(poll=lambda _: [(program.fileno(), select.POLLIN)])
    assert program._recv_internal(0.0)[0] is None


def test_a_line_can_be_waited_for_and_filtered_as_any_bus_of_python_cans(pair):
    program, drives = pair
    program.set_filters([{"can_id": 0x185, "can_mask": 0x7FF}])
    assert select.select([program], [], [], 0.0)[0] == []
    for can_id in (0x205, 0x185, 0x186):
        drives.send(can.Message(arbitration_id=can_id, is_extended_id=False))
    assert select.select([program], [], [], 1.0)[0] == [program]
    assert program.recv(1.0).arbitration_id == 0x185
    assert program.recv(0.0) is None


def test_a_line_that_was_shut_down_is_closed_without_a_complaint(caplog):
    ends = can_line()
    bus = PairBus(ends[0])
    bus.shutdown()
    bus.shutdown()
    assert ends[0].fileno() == -1
    ends[1].close()
    del bus
    gc.collect()
    assert not [
        told for told in caplog.messages if PairBus.__name__ in told
    ]  # others' buses may go here, too


def test_many_frames_are_sent_in_order_by_few_calls(ends):
    line = SocketCanTransmitter(ends[0])
    sent = [(0x200 + number, bytes((number,) * (number % 9))) for number in range(150)]
    sent[77] = (0x1234_5678, b"\7")
    assert line.send_all(sent) == 150
    ends[1].setblocking(False)
    single = SocketCanTransmitter(ends[0])
    received = [ends[1].recv(100) for _ in sent]
    for can_id, data in sent:
        single.send(can_id, data)
        assert ends[1].recv(100) == received.pop(0)


def test_of_many_frames_as_many_are_taken_as_the_queue_has_room_for(ends):
    line = SocketCanTransmitter(ends[0])
    filled = 0
    while (took := line.send_all([(0x205, bytes(8))] * 100)) == 100:
        filled += took
    assert took < 100
    assert line.send_all([(0x205, b"")]) == 0
    ends[1].recv(100)
    assert line.send_all([(0x206, b"")] * 9) < 9


def test_a_closed_socket_takes_none_of_several_frames():
    line = SocketCanTransmitter(_closed())
    assert line.send_all([(0x205, b"")]) == 0
    with pytest.raises(can.CanOperationError):
        line.send(0x205, b"")


def test_another_adapter_takes_frames_one_at_a_time():
    assert PythonCanTransmitter(None, None).send_all([(0x205, b"")]) == 0
