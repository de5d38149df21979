"""An axis with a single synchronous RPDO: its fast path gives the same frames as the general path."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.bus.pdo.plan import PdoRequirements, Policy, make_plan
from axisbus.bus.port import CanPort
from axisbus.cia402.port import Outputs
from axisbus.errors import StateError
from kit.bus.fake_bus import FakeBus, Slave
from kit.bus.pdo_configurations import objects, rpdo, tpdo

NODE, PERIOD, CYCLES = 5, 0.004, 400
MAPPINGS = (
    "607A/32 6060/8 6040/16",
    "6040/16 6060/8 607A/32",
    "6040/16 60FF/32 6071/16",
    "6040/16 0001/1 607A/32",
    "6040/16",
)
WORDS = (None, 0x06, 0x07, 0x0F, 0x1F, 0x10F, 0x02)
NUMBERS = (None, 0, 1, -1, 77, -(2**31), 2**31 - 1, 2**31, 70_000)


@pytest.fixture
def node(channel: Channel, fake: FakeBus) -> Iterator[CanopenNode]:
    slave = Slave(NODE, {(index, 0): bytes(4) for index in (0x607A, 0x60FF)})
    slave.objects |= {
        (0x6040, 0): bytes(2),
        (0x6060, 0): b"\x01",
        (0x6071, 0): bytes(2),
        (0x6041, 0): b"\x31\x02",
    }
    fake.peers.append(slave)
    with CanopenNode(channel, NODE) as node:
        yield node


def port_on(node: CanopenNode, mapping: str, transmission: int = 1) -> CanPort:
    device = DevicePdos((rpdo(1, mapping, transmission),), (tpdo(1, "6041/16", 1),))
    names = tuple(name for name, index in NAMES.items() if index in mapping)
    plan = make_plan(
        NODE,
        device,
        objects(),
        PdoRequirements(("statusword",), names),
        Policy(remap=False, communication=False),
    )
    return CanPort(node, plan, scan_period=PERIOD)


NAMES = {
    "controlword": "6040",
    "mode": "6060",
    "target_position": "607A",
    "target_velocity": "60FF",
    "target_torque": "6071",
}


def outputs(dice: random.Random) -> Outputs:
    one = dice.choice
    return Outputs(
        one(WORDS),
        one((None, None, 1, 8, -1)),
        one(NUMBERS),
        one(NUMBERS),
        one((None, 0, -5, 32767)),
        nmt_stop=dice.random() < 0.1,
    )


def written(port: CanPort, given: Outputs):
    try:
        port.write(given)
    except StateError as error:
        return str(error)
    return port.take_frames(), port.stop_frames()


@pytest.mark.parametrize("mapping", MAPPINGS)
@pytest.mark.parametrize("primed", [True, False])
def test_the_fast_path_for_one_rpdo_gives_the_same_frames_as_the_general_path(
    node: CanopenNode, mapping: str, primed: bool
) -> None:
    dice = random.Random(mapping)
    short, long = port_on(node, mapping), port_on(node, mapping)
    assert short._only_image is not None
    long._only_image = None
    if primed:
        short.prime()
        long.prime()
    seen = 0
    for number in range(CYCLES):
        given = outputs(dice)
        if number % 50 == 49:
            short.drop_frames()
            long.drop_frames()
        frames = written(short, given)
        assert frames == written(long, given), (number, given)
        seen += not isinstance(frames, str)
    assert seen
    short.close()
    long.close()


@pytest.mark.parametrize(
    ("mapping", "transmission"), [(MAPPINGS[0], 254), (MAPPINGS[0], 255), ("607A/32", 1)]
)
def test_an_event_driven_rpdo_or_one_without_controlword_does_not_use_the_fast_path(
    node: CanopenNode, mapping: str, transmission: int
) -> None:
    port = port_on(node, mapping, transmission)
    assert port._only_image is None
    port.close()
