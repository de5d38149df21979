"""A signal is received while the main thread is busy, and wakes it where the system gave the signal to another thread."""

from __future__ import annotations

import hashlib
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator

import pytest

from axisbus.ipc.own_socket import own_pair
from axisbus.machine.signal_shutdown import Wakeup

if sys.platform == "win32":
    pytest.skip("these signals are those of POSIX", allow_module_level=True)

NUMBER = signal.SIGUSR1


class Woken(Exception):
    """The exception that the handler raises in the main thread."""


class Listener:
    """Counts received and handled signals, with the time."""

    def __init__(self) -> None:
        self.heard: list[float] = []
        self.handled: list[float] = []
        self.ends = own_pair()
        self.wakeup = Wakeup(
            frozenset({NUMBER}),
            lambda _: self.heard.append(time.monotonic()),
            lambda: len(self.handled) >= len(self.heard),
            self.ends,
        )

    def close(self) -> None:
        for end in self.ends:
            end.close()

    def handle(self, *_: object) -> None:
        self.handled.append(time.monotonic())
        raise Woken


@pytest.fixture
def listener() -> Iterator[Listener]:
    made = Listener()
    before = signal.signal(NUMBER, made.handle)
    made.wakeup.start()
    yield made
    made.wakeup.stop()
    made.close()
    signal.signal(NUMBER, before)


def busy(seconds: float) -> None:
    """One call that lasts at least so long, lets other threads run, and notices no signal before its end."""
    start = time.monotonic()
    hashlib.pbkdf2_hmac("sha256", b"", b"", 20_000)
    rounds = int(20_000 * seconds / (time.monotonic() - start)) + 1
    hashlib.pbkdf2_hmac("sha256", b"", b"", rounds)


def test_a_signal_is_received_while_the_main_thread_is_in_a_long_call(listener: Listener) -> None:
    threading.Timer(0.3, os.kill, (os.getpid(), NUMBER)).start()
    with pytest.raises(Woken):
        busy(2.0)
    assert listener.handled[0] - listener.heard[0] > 0.3
    assert len(listener.heard) == 1


def test_a_signal_given_to_another_thread_wakes_the_main_thread(listener: Listener) -> None:
    stay = threading.Event()
    other = threading.Thread(target=stay.wait)
    other.start()
    start = time.monotonic()
    timer = threading.Timer(0.1, lambda: signal.pthread_kill(other.ident, NUMBER))
    timer.start()
    try:
        with pytest.raises(Woken):
            time.sleep(20.0)
    finally:
        stay.set()
    assert time.monotonic() - start < 10.0
    assert len(listener.heard) == 1  # the second one is an echo
    assert len(listener.handled) == 1


def test_the_previous_owner_of_the_wakeup_descriptor_still_gets_signals() -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    before = signal.set_wakeup_fd(writer)
    made = Listener()
    handler = signal.signal(NUMBER, lambda *_: None)
    try:
        made.wakeup.start()
        os.kill(os.getpid(), NUMBER)
        assert os.read(reader, 1) == bytes((NUMBER,))
        made.wakeup.stop()
        assert signal.set_wakeup_fd(before) == writer
    finally:
        signal.set_wakeup_fd(before)
        signal.signal(NUMBER, handler)
        os.close(reader)
        os.close(writer)
        made.close()
