"""Messages over a socket arrive whole and in order, whatever their size, and nobody who sends waits for anybody."""

from __future__ import annotations

import os
import signal
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from axisbus.wire.stream import Stream


def packed(message: object) -> bytes:
    assert isinstance(message, str)
    return message.encode()


@contextmanager
def line() -> Iterator[tuple[Stream, socket.socket]]:
    near, far = socket.socketpair()
    stream = Stream(near, packed, "test stream")
    try:
        yield stream, far
    finally:
        far.close()
        stream.finish()


@contextmanager
def both() -> Iterator[tuple[Stream, Stream]]:
    with line() as (near, end):
        far = Stream(end, packed, "test far stream")
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


def test_who_sends_does_not_wait_for_one_who_reads_nothing():
    with line() as (stream, _):
        began = time.monotonic()
        for _ in range(200):
            stream.send("x" * 10_000)
        assert time.monotonic() - began < 0.5
        assert stream.waiting > 100


def test_a_message_that_cannot_be_packed_keeps_no_other_from_its_way(caplog):
    with both() as (near, far):
        for message in ("one", 2, "three"):
            near.send(message)
        near.close(5.0)
        assert list(far.messages()) == [b"one", b"three"]
    assert "could not be sent" in caplog.text


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
def test_a_forked_child_that_lets_go_takes_nothing_from_its_parent():
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
