"""The simulated drive's boot loader: accepted data, their order, and its reports (CiA 302-3, numbers typed by hand)."""

from __future__ import annotations

import zlib
from pathlib import Path

import pytest

from axisbus import eds
from axisbus.cia301.nmt import NmtState
from axisbus.errors import SdoAbort
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from kit.eds.loader import OLD, loader_eds, program

NEW = (15_400, 43_200_000)
STATE = 0x0800_0022


@pytest.fixture
def device(tmp_path: Path) -> Device:
    made = device_from_eds(eds.load(tmp_path / loader_eds(tmp_path)), 5)
    made.power_on()
    return made


def date(device: Device) -> tuple[int, int]:
    return device.read(0x1F52, 1), device.read(0x1F52, 2)


def order(device: Device, *orders: int) -> None:
    for each in orders:
        device.write(0x1F51, 1, each)


def test_a_drive_without_the_objects_has_no_loader():
    assert device_from_eds(eds.load("eds/generic-cia402.eds")).loader is None


def test_a_program_runs_after_stop_clear_data_and_start(device):
    assert (date(device), device.read(0x1F51, 1)) == (OLD, 1)
    order(device, 0, 3)
    assert (date(device), device.read(0x1F51, 1), device.read(0x1F57, 1)) == ((0, 0), 3, 2)
    device.download(0x1F50, 1, program(NEW))
    assert (device.read(0x1F57, 1), device.read(0x1F51, 1)) == (0, 0)
    order(device, 1)
    device.step(0.03)
    assert device.nmt is NmtState.INITIALISING
    device.step(0.1)
    assert (date(device), device.read(0x1F51, 1)) == (NEW, 1)
    assert device.boot_ups == 2


@pytest.mark.parametrize("orders", [(3,), (0, 3, 1), (7,)], ids=["clear first", "start nothing", "unknown"])
def test_orders_that_do_not_fit_are_refused(device, orders):
    with pytest.raises(SdoAbort) as caught:
        order(device, *orders)
    assert caught.value.code in (STATE, 0x0609_0030)


def test_data_for_a_program_that_runs_are_refused(device):
    with pytest.raises(SdoAbort) as caught:
        device.download(0x1F50, 1, program(NEW))
    assert caught.value.code == STATE
    assert date(device) == OLD


def test_memory_that_was_not_cleared_is_reported_as_error_4(device):
    order(device, 0)
    device.download(0x1F50, 1, program(NEW))
    assert device.read(0x1F57, 1) == 4 << 1


def test_an_invalid_program_is_reported_as_error_3(device):
    order(device, 0, 3)
    device.download(0x1F50, 1, b"abc")
    assert device.read(0x1F57, 1) == 3 << 1


def test_clearing_the_program_memory_takes_time_and_may_stop_sdo_answers(device):
    device.dials.program.clear_time, device.dials.program.deaf = 2.0, True
    order(device, 0, 3)
    assert device.read(0x1F57, 1) == 1
    assert not device.answers_sdo
    with pytest.raises(SdoAbort):
        device.download(0x1F50, 1, program(NEW))
    device.step(2.1)
    assert device.answers_sdo
    assert device.read(0x1F57, 1) == 2


def test_a_node_that_was_stopped_runs_its_old_program_after_power_is_back(device):
    order(device, 0)
    device.nmt_command(0x81)
    device.step(0.1)
    assert (date(device), device.read(0x1F51, 1)) == (OLD, 1)


def test_a_node_that_was_cleared_has_no_program_after_power_up(device):
    order(device, 0, 3)
    device.nmt_command(0x81)
    device.step(0.1)
    assert (date(device), device.read(0x1F51, 1)) == ((0, 0), 3)


def test_a_stop_that_restarts_the_node_ends_in_the_loader(device):
    device.dials.program.stop_restarts = True
    order(device, 0)
    device.step(0.1)
    assert (device.boot_ups, device.read(0x1F51, 1)) == (2, 0)
    order(device, 3)


# -- a loader with few objects, a small memory, a checksum, and a supply that fails ---------------------------------------


def switched_off_and_on(device: Device) -> None:
    for unpowered in (True, False):
        device.dials.unpowered = unpowered
        device.step(0.1)


def test_a_loader_with_few_objects_has_no_axis(device):
    device.dials.program.few_objects = device.dials.program.stop_restarts = True
    assert device.read(0x6041) & 0x6F == 0x40
    order(device, 0)
    device.step(0.1)
    assert device.read(0x1000) == device.dictionary.defaults[0x1000 << 8]
    for access in (lambda: device.read(0x6041), lambda: device.write(0x6081, 0, 5)):
        with pytest.raises(SdoAbort) as caught:
            access()
        assert caught.value.code == 0x0602_0000
    order(device, 3)
    device.download(0x1F50, 1, program(NEW))
    order(device, 1)
    device.step(0.2)
    assert device.read(0x6041) & 0x6F == 0x40


def test_a_program_that_is_longer_than_the_memory_is_reported_as_error_6(device):
    device.dials.program.capacity = 2999
    order(device, 0, 3)
    device.download(0x1F50, 1, program(NEW))
    assert device.read(0x1F57, 1) == 6 << 1
    device.dials.program.capacity = 3000
    order(device, 3)
    device.download(0x1F50, 1, program(NEW))
    assert device.read(0x1F57, 1) == 0


def test_a_program_without_its_checksum_is_reported_as_error_3(device):
    device.dials.program.checksum = True
    order(device, 0, 3)
    device.download(0x1F50, 1, program(NEW))
    assert device.read(0x1F57, 1) == 3 << 1
    with pytest.raises(SdoAbort):
        order(device, 1)
    order(device, 3)
    device.download(0x1F50, 1, program(NEW) + zlib.crc32(program(NEW)).to_bytes(4, "little"))
    order(device, 1)
    device.step(0.2)
    assert (date(device), device.read(0x1F51, 1)) == (NEW, 1)


def test_a_supply_that_fails_while_the_memory_is_written_leaves_no_valid_program(device):
    device.dials.program.flash_time = 2.0
    order(device, 0, 3)
    device.download(0x1F50, 1, program(NEW))
    device.step(1.9)
    switched_off_and_on(device)
    assert (device.read(0x1F51, 1), device.read(0x1F57, 1)) == (0, 1 << 1)
    with pytest.raises(SdoAbort):
        order(device, 1)
    order(device, 3)
    device.download(0x1F50, 1, program(NEW))
    device.step(2.1)
    switched_off_and_on(device)
    assert (date(device), device.read(0x1F51, 1)) == (NEW, 1)


def test_a_supply_that_fails_while_the_memory_is_cleared_leaves_the_node_in_its_loader(device):
    device.dials.program.clear_time = 2.0
    order(device, 0, 3)
    device.step(1.0)
    switched_off_and_on(device)
    assert (date(device), device.read(0x1F51, 1), device.read(0x1F57, 1)) == ((0, 0), 3, 1 << 1)
