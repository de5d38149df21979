"""Our LSS master and the simulated drive's LSS slave on a virtual bus: two implementations that share no code."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.lss import LssMaster
from axisbus.bus.node.discover import scan
from axisbus.cia305.dialogue import LssTiming
from axisbus.cia305.scan_result import KnownIdentity
from axisbus.cia305.services import LssAddress
from axisbus.eds import builtin
from axisbus.eds import load as load_eds
from axisbus.eds.model import Eds
from axisbus.errors import LssRefused
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.node.network import SimulatedNetwork

_channels = (f"test-bus-lss-{number}" for number in itertools.count())
PATIENT = LssTiming(floor=0.03, first=0.3)  # the machine may be busy
MAKE = KnownIdentity(vendor_id=0xC0B00, product_code=0, revision_number=0)
Bus = Callable[..., tuple[list[Device], LssMaster, Channel]]


@pytest.fixture(scope="module")
def eds() -> Eds:
    return load_eds(builtin.resolve("builtin:gim6010-8", Path()))


@pytest.fixture
def bus(eds: Eds) -> Iterator[Bus]:
    with ExitStack() as stack:

        def make(*serials: int, node_id: int = 255) -> tuple[list[Device], LssMaster, Channel]:
            name = next(_channels)
            devices = [device_from_eds(eds, node_id, serial=serial, seed=serial) for serial in serials]
            stack.enter_context(SimulatedNetwork(name, devices))
            channel = stack.enter_context(Channel.open("virtual", name))
            return devices, LssMaster(channel, PATIENT, beside_operation=True), channel

        yield make


def address(serial: int) -> LssAddress:
    return LssAddress(0xC0B00, 0, 0, serial)


def test_from_two_bare_drives_to_two_nodes(bus: Bus) -> None:
    devices, master, channel = bus(0x10, 0x11)
    found = master.find(MAKE)
    assert [each.address for each in found.slaves] == [address(0x10), address(0x11)]
    for node_id, each in enumerate(found.slaves, start=1):
        assert master.set_node_id(each.address, node_id, store=True).booted
    assert master.find(MAKE).slaves == ()
    assert [(node.node_id, node.identity.serial) for node in scan(channel)] == [(1, 0x10), (2, 0x11)]
    assert [device.lss.stored for device in devices] == [1, 2]


def test_a_lossy_line_with_uneven_answers(bus: Bus) -> None:
    devices, master, _ = bus(0x40, 0x41, 0x80000000)
    for device in devices:
        device.dials.lss.loss = 0.02
        device.dials.lss.jitter = 0.004
    assert [each.address.serial_number for each in master.find(MAKE).slaves] == [0x40, 0x41, 0x80000000]


def test_refusals_of_the_simulated_drive(bus: Bus) -> None:
    (device,), master, _ = bus(7)
    device.dials.lss.store_error = 1
    with pytest.raises(LssRefused, match="cannot store its configuration") as caught:
        master.set_node_id(address(7), 5, store=True)
    assert caught.value.code == 1
    device.dials.lss.refused_rates = frozenset({800_000})
    with pytest.raises(LssRefused, match="does not support this bit rate"):
        master.set_bit_rate([address(7)], 800_000)
    master.set_bit_rate([address(7)], 500_000)
    master.activate([address(7)], 0.05)
    assert master.inquire(None).address == address(7)
    assert device.lss.bit_rate == 500_000


def test_a_node_that_has_a_node_id_gets_another_and_loses_it_again(bus: Bus) -> None:
    (device,), master, channel = bus(7, node_id=3)
    assert [node.node_id for node in scan(channel, ids=(3,))] == [3]  # booted
    assert master.inquire(address(7)).node_id == 3
    assert master.set_node_id(address(7), 4, reset=True).booted
    assert device.node_id == 4
    master.set_node_id(address(7), 255, reset=True)
    assert [each.address for each in master.find(MAKE).slaves] == [address(7)]
