"""Frames that the receive thread takes from a SocketCAN link at once are equal to those that python-can takes one by one."""

from __future__ import annotations

import socket
import time

import can
import pytest
from can.interfaces.socketcan.socketcan import capture_message
from hypothesis import given
from hypothesis import strategies as st

from axisbus.bus.link.raw_sockets import PythonCanSource, SocketCanSource, frame_source_of
from kit.bus.can_frame import can_frame

SO_TIMESTAMPNS = 35
EXTENDED, REMOTE, ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000


class Ends:
    """Two lines to the same intake: ``near`` is taken at once, ``single`` one by one by python-can."""

    def __init__(self) -> None:
        self.far, self.near = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.other, self.single = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for end in (self.near, self.single):
            end.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.intake = SocketCanSource(self.near)

    def send(self, frame: bytes) -> None:
        """Put a frame on both."""
        self.far.send(frame)
        self.other.send(frame)

    def close(self) -> None:
        """Release all."""
        for end in (self.far, self.near, self.other, self.single):
            end.close()


@pytest.fixture
def ends():
    made = Ends()
    yield made
    made.close()


def same(taken, message: can.Message) -> bool:
    """Whether both are the same frame, whatever the time."""
    if isinstance(taken, tuple):
        can_id, data, _ = taken
        plain = not (message.is_extended_id or message.is_remote_frame or message.is_error_frame)
        return plain and (can_id, data) == (message.arbitration_id, bytes(message.data))
    return taken.equals(message, timestamp_delta=None, check_channel=False)


FRAMES = st.one_of(
    st.builds(can_frame, st.integers(0, 0x7FF), st.binary(max_size=8)),
    st.builds(
        can_frame, st.integers(0, 0x1FFF_FFFF).map(lambda value: value | EXTENDED), st.binary(max_size=8)
    ),
    st.builds(
        can_frame, st.integers(0, 0x7FF).map(lambda value: value | REMOTE), st.just(b""), st.integers(0, 8)
    ),
    st.builds(
        can_frame, st.integers(0, 0x1FF).map(lambda value: value | ERROR), st.binary(min_size=8, max_size=8)
    ),
)


@given(st.lists(FRAMES, min_size=1, max_size=70))
def test_all_kinds_of_frames_are_read_as_by_python_can(frames):
    ends = Ends()
    try:
        for frame in frames:
            ends.send(frame)
        taken = []
        while len(taken) < len(frames):
            some = ends.intake.take(0.0)
            assert some, f"{len(taken)} of {len(frames)}"
            taken += some
        for one in taken:
            message = capture_message(ends.single)
            assert same(one, message), (one, message)
    finally:
        ends.close()


def test_frames_received_together_are_taken_together_with_the_kernels_time(ends):
    before = time.time()
    for node_id in range(1, 17):
        ends.far.send(can_frame(0x700 + node_id, b"\5"))
    taken = ends.intake.take(0.0)
    assert [(can_id, data) for can_id, data, _ in taken] == [
        (0x700 + node_id, b"\5") for node_id in range(1, 17)
    ]
    assert all(before - 0.001 <= came <= time.time() + 0.001 for _, _, came in taken)


def test_without_a_frame_it_waits_no_longer_than_its_timeout(ends):
    began = time.monotonic()
    assert list(ends.intake.take(0.02)) == []
    assert 0.015 < time.monotonic() - began < 1.0


def test_a_line_whose_other_end_has_closed_is_reported_and_not_read_again(ends):
    ends.far.send(can_frame(0x181, b"\1"))
    ends.far.close()
    assert [can_id for can_id, _, _ in ends.intake.take(0.0)] == [0x181]
    with pytest.raises(OSError, match="no program is at the other end"):
        ends.intake.take(0.0)


def test_a_line_that_was_closed_here_is_reported(ends):
    ends.far.send(can_frame(0x181, b"\1"))
    ends.near.close()
    with pytest.raises(OSError):  # whichever the system finds first
        ends.intake.take(0.0)


def test_other_adapters_and_fd_links_are_read_by_python_can(ends):
    class SocketcanBus:
        socket = ends.near
        protocol = can.CanProtocol.CAN_FD

    assert isinstance(frame_source_of(SocketcanBus()), PythonCanSource)
    SocketcanBus.protocol = can.CanProtocol.CAN_20
    assert isinstance(frame_source_of(SocketcanBus()), SocketCanSource)
    with can.Bus(interface="virtual", channel="intake") as bus:
        assert isinstance(frame_source_of(bus), PythonCanSource)
