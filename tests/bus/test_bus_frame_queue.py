"""The inbox of the receive thread: in order, and no wait outlives its deadline, however short it is."""

from __future__ import annotations

import ast
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import axisbus
from axisbus.bus.link.channel import Channel
from axisbus.bus.link.frame_queue import UnboundedQueue
from axisbus.bus.lss import LssMaster
from axisbus.bus.sdo.transfer import SdoConnection
from axisbus.clock import REAL
from kit.bus.fake_bus import FakeBus

WAITS = 100_000
SHORT = [step * 1e-7 for step in range(1, 101)]  # seconds: 0.1 to 10 us
WATCHDOG = 60.0  # seconds; 10^5 waits take about 1 s
PACKAGE = Path(axisbus.__file__).parent
HERE = Path(__file__).parent


def within_watchdog(work: Callable[[], None]) -> None:
    """Run ``work`` in a thread that is left behind when it does not end: then the test fails, and does not hang."""
    ended: list[BaseException | None] = []

    def run() -> None:
        try:
            work()
        except BaseException as error:  # noqa: BLE001 - reported below
            ended.append(error)
        else:
            ended.append(None)

    thread = threading.Thread(target=run, name="waits", daemon=True)
    thread.start()
    thread.join(WATCHDOG)
    assert not thread.is_alive(), f"a wait of at most 10 us has not ended within {WATCHDOG:g} s"
    assert ended == [None]


def test_a_hundred_thousand_waits_of_a_few_microseconds_all_end() -> None:
    def work() -> None:
        old: UnboundedQueue[int] = UnboundedQueue(REAL)
        for number in range(WAITS):
            inbox = UnboundedQueue(REAL) if number % 2 else old  # a new one's lock has never been taken
            assert inbox.take(time.monotonic() + SHORT[number % len(SHORT)]) is None

    within_watchdog(work)


def test_short_waits_end_while_others_put_and_take() -> None:
    inbox: UnboundedQueue[int] = UnboundedQueue(REAL)
    over = threading.Event()

    def putting() -> None:
        while not over.is_set():
            inbox.put(1)
            time.sleep(1e-5)

    def work() -> None:
        for number in range(WAITS // 10):
            inbox.take(time.monotonic() + SHORT[number % len(SHORT)])

    other = threading.Thread(target=putting, daemon=True)
    other.start()
    try:
        within_watchdog(work)
    finally:
        over.set()
        other.join()


def test_the_waits_of_sdo_and_lss_end_however_short(channel: Channel, fake: FakeBus) -> None:
    def work() -> None:
        for number in range(WAITS // 5):
            patience = SHORT[number % len(SHORT)]
            line, master = (
                SdoConnection(channel, 5),
                LssMaster(channel),
            )  # new: no thread has waited there before
            assert line.receive(patience) is None
            assert master._take(time.monotonic() + patience) is None
            line.close()

    within_watchdog(work)


def test_a_wait_whose_time_has_passed_takes_the_queued_items_and_does_not_block() -> None:
    inbox: UnboundedQueue[int] = UnboundedQueue(REAL)
    assert inbox.take(time.monotonic() - 1.0) is None
    inbox.put(1)
    inbox.put(2)
    assert [inbox.take(time.monotonic() - 1.0) for _ in range(3)] == [1, 2, None]


@pytest.mark.parametrize("empty", [b"", 0])
def test_an_item_that_counts_as_false_is_an_item(empty: object) -> None:
    inbox: UnboundedQueue[object] = UnboundedQueue(REAL)
    inbox.put(empty)
    assert inbox.take(0.0) == empty


def test_a_new_item_wakes_a_thread_that_waits_long() -> None:
    inbox: UnboundedQueue[str] = UnboundedQueue(REAL)
    threading.Timer(0.05, inbox.put, ["woken"]).start()
    began = time.monotonic()
    assert inbox.take(began + 30.0) == "woken"
    assert time.monotonic() - began < 10.0


def simple_queues(path: Path) -> list[int]:
    """The lines of a module that name ``SimpleQueue``."""
    text = path.read_text("utf-8")
    if "SimpleQueue" not in text:  # parsing all modules takes seconds
        return []
    return [
        node.lineno
        for node in ast.walk(ast.parse(text))
        if (isinstance(node, ast.Attribute) and node.attr == "SimpleQueue")
        or (isinstance(node, ast.Name) and node.id == "SimpleQueue")
        or (isinstance(node, ast.alias) and node.name == "SimpleQueue")
    ]


@pytest.mark.parametrize("root", [PACKAGE, HERE.parent], ids=["the package", "its tests"])
def test_no_module_waits_at_a_simple_queue(root: Path) -> None:
    """Its wait may have no end (see ``bus.link.frame_queue``), and a call with a time-out looks like one without."""
    modules = sorted(root.rglob("*.py"))
    assert len(modules) > 50
    found = [f"{path.relative_to(root)}:{line}" for path in modules for line in simple_queues(path)]
    assert found == []


def test_the_search_for_simple_queues_finds_them(tmp_path: Path) -> None:
    module = tmp_path / "module.py"
    module.write_text("import queue\nfrom queue import SimpleQueue as Q\nq: queue.SimpleQueue[int] = Q()\n")
    assert simple_queues(module) == [2, 3]
