"""Virtual time: waiting takes no real time, events come in the order of their deadlines, and every run is the same."""

from __future__ import annotations

import queue
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import can
import pytest

from kit.scenarios.simulated_bus import Line, turning
from kit.virtual_time import Deadlock, virtual_time

HOUR = 3600.0


def test_waiting_takes_no_real_time() -> None:
    began = time.perf_counter()
    with virtual_time():
        start = time.monotonic()
        time.sleep(HOUR)
        assert not threading.Event().wait(HOUR)
        with pytest.raises(queue.Empty):
            queue.Queue().get(timeout=HOUR)
        assert time.monotonic() - start == pytest.approx(3 * HOUR, abs=0.01)
    assert time.perf_counter() - began < 60.0


def test_threads_run_in_the_order_of_their_deadlines() -> None:
    seen: list[float] = []
    with virtual_time():
        start = time.monotonic()

        def one(after: float) -> None:
            time.sleep(after)
            seen.append(round(time.monotonic() - start, 3))

        with ThreadPoolExecutor(3) as pool:
            list(pool.map(one, (3.0, 1.0, 2.0)))
        timer = threading.Timer(5.0, lambda: seen.append(-1.0))
        timer.start()
        timer.join()
        assert not timer.is_alive()
    assert seen == [1.0, 2.0, 3.0, -1.0]


def test_a_lock_has_a_timeout_in_virtual_time() -> None:
    with virtual_time():
        lock, start = threading.Lock(), time.monotonic()
        with lock:
            assert not lock.acquire(timeout=2.0)
            taken = threading.Thread(target=lock.acquire)
            taken.start()
            time.sleep(1.0)
            assert taken.is_alive()
        taken.join()
        assert lock.locked()
        assert time.monotonic() - start == pytest.approx(3.0, abs=0.01)


def test_sockets_block_in_virtual_time() -> None:
    with virtual_time():
        near, far = socket.socketpair()
        with near, far:
            near.settimeout(3.0)
            start = time.monotonic()
            with pytest.raises(TimeoutError):
                near.recv(1)
            assert time.monotonic() - start == pytest.approx(3.0, abs=0.01)
            near.settimeout(None)
            data = bytes(1_000_000)  # more than the kernel takes at once
            sends = threading.Thread(target=near.sendall, args=(data,))
            sends.start()
            time.sleep(2.0)
            assert sends.is_alive()
            assert far.recv(len(data)) != b""
            with pytest.raises(BlockingIOError):
                near.recv(1, socket.MSG_DONTWAIT)
            while sends.is_alive():
                far.recv(len(data))
            assert time.monotonic() - start == pytest.approx(5.0, abs=0.01)


def test_virtual_time_does_not_pass_while_data_are_in_transit() -> None:
    with virtual_time(), socket.create_server(("127.0.0.1", 0)) as server:

        def echo() -> None:
            line, _ = server.accept()
            with line:
                while data := line.recv(100):
                    line.sendall(data)

        threading.Thread(target=echo).start()
        with socket.create_connection(server.getsockname(), 0.001) as line:
            for number in range(300):
                line.sendall(bytes((number % 256,)))
                assert line.recv(100) == bytes((number % 256,))


def test_a_local_server_whose_queue_is_full_lets_a_client_wait(tmp_path: Path) -> None:
    with virtual_time(), ExitStack() as stack:
        server = stack.enter_context(socket.socket(socket.AF_UNIX))
        server.bind(str(tmp_path / "server"))
        server.listen(0)
        clients = [stack.enter_context(socket.socket(socket.AF_UNIX)) for _ in range(3)]
        clients[0].connect(server.getsockname())
        clients[1].settimeout(1.0)
        with pytest.raises(BlockingIOError):
            clients[1].connect(server.getsockname())
        late = threading.Timer(2.0, lambda: stack.enter_context(server.accept()[0]))
        late.start()
        start = time.monotonic()
        clients[2].connect(server.getsockname())
        assert time.monotonic() - start == pytest.approx(2.0, abs=0.01)
        late.join()


def test_a_deadlock_is_reported() -> None:
    with virtual_time(), pytest.raises(Deadlock, match="all threads are blocked"):
        threading.Event().wait()


def test_threads_that_are_left_are_stopped() -> None:
    with virtual_time():
        left = threading.Thread(target=threading.Event().wait)
        left.start()
        assert left.is_alive()
    left.join(10.0)
    assert not left.is_alive()


def frames_of(folder: Path) -> list[tuple[float, int, bytes]]:
    """Return all frames of a machine with two axes from open to close: time (s), COB-ID and data."""
    folder.mkdir()
    seen: list[tuple[float, int, bytes]] = []
    with (
        virtual_time(),
        Line(folder, "xy") as line,
        can.Bus(interface="virtual", channel=line.channel) as ear,
    ):
        hears = can.Notifier(
            ear, [lambda frame: seen.append((frame.timestamp, frame.arbitration_id, bytes(frame.data)))]
        )
        with line.open() as machine:
            turning(machine, line)
            machine["x"].move_relative(20.0).wait(10.0)
            machine["y"].halt().wait(10.0)
        hears.stop()
    return seen


def test_the_same_scenario_sends_the_same_frames_at_the_same_times(tmp_path: Path) -> None:
    # A first run fills the caches. Without them the clock is read more often, each reading takes 1 µs, and a cycle may begin later.
    _, once, again = (frames_of(tmp_path / name) for name in ("first", "once", "again"))
    assert len(once) > 500
    assert [frame[1:] for frame in once] == [frame[1:] for frame in again]
    since = [[at - scenario[0][0] for at, *_ in scenario] for scenario in (once, again)]
    assert since[0] == pytest.approx(since[1], abs=1e-5)
