"""The same work on many nodes at once, on one virtual bus with simulated drives that take their time."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.sdo.client import SdoClient
from axisbus.eds import load
from axisbus.errors import SdoAbort, SdoTimeout
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.node.network import SimulatedNetwork
from kit.bus.node_threads import on_each

EDS = load(Path(__file__).parents[2] / "eds" / "generic-cia402.eds")
KEYS = [(item.index, sub) for item in EDS for sub, variable in item.subs.items() if variable.readable][:100]
ANSWER = 0.002
_names = itertools.count()


@pytest.fixture
def devices() -> list[Device]:
    return [device_from_eds(EDS, node_id) for node_id in range(1, 17)]


@pytest.fixture
def clients(devices: list[Device]) -> Iterator[list[SdoClient]]:
    name = f"sixteen {next(_names)}"
    with ExitStack() as stack:
        channel = stack.enter_context(Channel.open("virtual", name))
        stack.enter_context(SimulatedNetwork(name, devices))
        made = [SdoClient(channel, device.node_id, timeout=5.0) for device in devices]
        for client in made:
            stack.callback(client.close)
        on_each(made, lambda client: client.upload(0x1000))  # they have booted
        yield made


def read_all(client: SdoClient) -> list[bytes]:
    return [client.upload(*key) for key in KEYS]


def seconds(work: object) -> float:
    begin = time.perf_counter()
    work()  # type: ignore[operator]
    return time.perf_counter() - begin


@pytest.mark.timeout(240)
def test_sixteen_nodes_take_at_most_two_and_a_half_times_as_long_as_one(devices, clients):
    """Best of several, measured in turn, because the machine may be busy with something else."""
    for device in devices:
        device.dials.sdo_delay = ANSWER
    assert len(KEYS) == 100
    one = many = float("inf")
    for _ in range(30):
        one = min(one, seconds(lambda: read_all(clients[0])))
        many = min(many, seconds(lambda: on_each(clients, read_all)))
        if many <= 2.5 * one:
            break
    assert one >= 100 * ANSWER  # the delay is real
    assert many <= 2.5 * one


def test_every_node_gives_its_own_answers(devices, clients):
    for device in devices:
        device.dictionary.values[0x1018 << 8 | 4] = 1000 + device.node_id
    outcomes = on_each(clients, lambda client: client.read(0x1018, 4))
    assert {node_id: outcome.value for node_id, outcome in outcomes.items()} == {
        node_id: 1000 + node_id for node_id in range(1, 17)
    }


def test_a_node_that_fails_stops_no_other(devices, clients):
    devices[2].dials.sdo_aborts[0x1000, 0] = 0x0800_0022
    devices[4].dials.sdo_silent = True
    clients[4].timeout = 0.05
    outcomes = on_each(clients, lambda client: client.upload(0x1000))
    assert isinstance(outcomes[3].error, SdoAbort)
    assert isinstance(outcomes[5].error, SdoTimeout)
    assert sum(outcome.error is None for outcome in outcomes.values()) == 14


def test_a_fault_of_the_work_itself_is_raised(clients):
    with pytest.raises(ZeroDivisionError):
        on_each(clients, lambda client: 1 // (client.node_id - 7))


def test_no_nodes_no_work():
    assert on_each([], lambda client: client.node_id) == {}
