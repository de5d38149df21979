"""Messages over a socket arrive whole and in order, whatever their size, and no sender waits."""

from __future__ import annotations

import os
import signal
import socket
import struct
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from axisbus.ipc import stream as stream_module
from axisbus.ipc.own_socket import FarEnd, inode_of
from axisbus.ipc.rate import Bucket
from axisbus.ipc.stream import MessageStream


def packed(message: object) -> bytes:
    assert isinstance(message, str)
    return message.encode()


@contextmanager
def line() -> Iterator[tuple[MessageStream, socket.socket]]:
    near, far = socket.socketpair()
    stream = MessageStream(near, packed, "test stream")
    try:
        yield stream, far
    finally:
        far.close()
        stream.finish()


@contextmanager
def both() -> Iterator[tuple[MessageStream, MessageStream]]:
    with line() as (near, end):
        far = MessageStream(end, packed, "test far stream")
        yield near, far
        near.close()
        far.finish()


def test_messages_arrive_in_order_and_whole():
    with both() as (near, far):
        sent = ["", "a", "b" * 100_000, "ü" * 7, b"packed already"]
        for message in sent:
            near.send(message)
        near.close(5.0)
        wanted = [message if isinstance(message, bytes) else message.encode() for message in sent]
        assert list(far.messages()) == wanted


def test_the_end_of_a_connection_ends_the_messages_in_the_middle_of_one_too():
    with line() as (stream, far):
        far.sendall(struct.pack("<I", 5) + b"whole" + struct.pack("<I", 100) + b"half")
        far.close()
        assert list(stream.messages()) == [b"whole"]


def test_nonsense_ends_the_messages():
    with line() as (stream, far):
        far.sendall(b"\xff" * 50)
        assert list(stream.messages()) == []


def test_a_sender_does_not_wait_for_a_reader_that_reads_nothing():
    with line() as (stream, _):
        began = time.monotonic()
        for _ in range(200):
            stream.send("x" * 10_000)
        assert time.monotonic() - began < 0.5
        assert stream.waiting > 100


def test_a_message_that_cannot_be_packed_does_not_delay_the_others(caplog):
    with both() as (near, far):
        for message in ("one", 2, "three"):
            near.send(message)
        near.close(5.0)
        assert list(far.messages()) == [b"one", b"three"]
    assert "could not be sent" in caplog.text


def test_a_pause_of_the_computer_while_a_connection_is_closed_loses_no_message(monkeypatch):
    now, packing, paused = [0.0], threading.Event(), threading.Event()

    def slowly(message: object) -> bytes:
        packing.set()
        assert paused.wait(10.0)
        return packed(message)

    def pause() -> float:
        """Each look at the clock is an hour after the one before; from the second one on the sender runs again."""
        now[0] += 3600.0
        if now[0] > 2 * 3600.0:
            paused.set()
        return now[0]

    with both() as (near, far):
        monkeypatch.setattr(near, "_pack", slowly)
        near.send("the last one")
        assert packing.wait(10.0)
        monkeypatch.setattr(stream_module, "time", SimpleNamespace(monotonic=pause), raising=False)
        near.close(2.0)
        assert list(far.messages()) == [b"the last one"]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="POSIX")
def test_a_signal_handler_may_send_while_the_same_thread_sends():
    with both() as (near, far):
        count = 0

        def handler(*_: object) -> None:
            nonlocal count
            count += 1
            near.send("signal")

        before = signal.signal(signal.SIGALRM, handler)
        signal.setitimer(signal.ITIMER_REAL, 0.001, 0.001)
        heard: list[bytes] = []
        reader = threading.Thread(target=lambda: heard.extend(far.messages()))
        reader.start()
        try:
            for _ in range(20_000):
                near.send("main")
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)
        near.close(20.0)
        reader.join(20.0)
    assert count > 3
    assert heard.count(b"main") == 20_000
    assert heard.count(b"signal") == count


@pytest.mark.skipif(not hasattr(os, "fork"), reason="POSIX")
def test_a_forked_child_that_disowns_its_streams_does_not_close_those_of_its_parent():
    with both() as (near, far):
        if (child := os.fork()) == 0:
            near.disown()
            far.disown()
            near.send("of the child")
            os._exit(0)
        os.waitpid(child, 0)
        near.send("of the parent")
        near.close(5.0)
        assert list(far.messages()) == [b"of the parent"]


def test_a_reader_that_looks_ends_both_ends_when_its_number_is_closed():
    with both() as (near, far):
        near.watch_for_loss()
        heard: list[bytes] = []
        reader = threading.Thread(target=lambda: heard.extend(near.messages()))
        reader.start()
        time.sleep(0.05)  # it waits in the kernel now
        os.close(near._line._line.fileno())
        assert list(far.messages()) == []
        reader.join(5.0)
        assert near.lost
        assert not far.lost


@pytest.mark.parametrize("end", ["_line", "_wake_receiver", "_wake_source"])
def test_a_file_that_has_taken_a_sockets_number_is_neither_read_nor_written_nor_closed(end, tmp_path):
    with both() as (near, far):
        near.watch_for_loss()
        reader = threading.Thread(target=lambda: list(near.messages()))
        reader.start()
        number = getattr(near, end)._line.fileno()
        with (tmp_path / "file").open("w+b") as file:
            file.write(b"of the program's own")
            file.flush()
            file.seek(0)
            os.dup2(file.fileno(), number)
            for _ in range(5):
                near.send("not into the file")
                time.sleep(0.05)
            assert b"of the program" not in b"".join(far.messages())
            reader.join(5.0)
            near.finish()
            assert near.lost
            assert os.read(number, 100) == b"of the program's own"
        os.close(number)


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_a_far_end_that_its_process_has_lost_is_seen_though_a_copy_is_open():
    near, far = socket.socketpair()
    with near:
        seen = FarEnd(os.getpid(), far.fileno(), inode_of(far))
        unknown = FarEnd(os.getpid(), far.fileno(), inode_of(near))
        assert not seen.lost
        number = far.detach()
        copy = os.dup(number)
        os.close(number)
        assert seen.lost
        assert os.dup2(near.fileno(), number) == number
        assert seen.lost
        assert not unknown.lost
        os.close(number)
        os.close(copy)


def test_a_rate_permits_a_burst_then_a_message_at_a_time_and_a_burst_again_after_a_pause():
    rate = Bucket(rate=8.0, burst=3.0)
    assert [rate.take(10.0) for _ in range(4)] == [True, True, True, False]
    assert [rate.take(10.125) for _ in range(2)] == [True, False]
    assert [rate.take(20.0) for _ in range(4)] == [True, True, True, False]
