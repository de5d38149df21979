"""Fixtures of the bus tests: an open channel on the fake bus, closed after each test, which must leave no thread behind."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from kit.bus.fake_bus import FakeBus, Slave, eventually


@pytest.fixture
def fake() -> FakeBus:
    return FakeBus()


@pytest.fixture
def channel(fake: FakeBus) -> Iterator[Channel]:
    with Channel(fake, "fake:0") as channel:
        yield channel


@pytest.fixture
def slave(fake: FakeBus) -> Slave:
    slave = Slave(5)
    fake.peers.append(slave)
    return slave


@pytest.fixture
def node(channel: Channel, slave: Slave) -> Iterator[CanopenNode]:
    with CanopenNode(channel, 5) as node:
        yield node


@pytest.fixture(autouse=True)
def no_thread_left() -> Iterator[None]:
    before = set(threading.enumerate())
    yield
    eventually(
        lambda: not [t for t in threading.enumerate() if t not in before and t.name.startswith("axisbus")]
    )
