"""A simulated drive from every maker's EDS file: it can be enabled, and moved where the file has the objects for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus import eds
from axisbus.errors import SdoAbort
from axisbus.sim.build import device_from_eds, modes_of
from axisbus.sim.device import Device
from kit.corpus import corpus_files
from kit.sim.rig import state

CHECKOUT = Path(__file__).parents[2]
BUILTIN = sorted(
    path for path in (CHECKOUT / "eds").glob("*.eds") if path.stem != "generic-cia401"
)  # no drive


def write(device: Device, index: int, value: int, subindex: int = 0) -> None:
    """Write where the object exists and takes the value; the drive's own value serves otherwise."""
    try:
        device.write(index, subindex, value)
    except SdoAbort as refused:
        assert refused.code in (0x06020000, 0x06010002, 0x06090011, 0x06090031, 0x06090032, 0x06070010)  # noqa: PT017


def run(device: Device, seconds: float) -> None:
    for _ in range(round(seconds / 0.01)):
        device.step(0.01)


def enable(device: Device, mode: int) -> None:
    drive = device.drive
    drive.mode = mode
    for word in (0x06, 0x07, 0x0F):
        drive.controlword = word
        run(device, 0.05)
    assert state(drive.statusword) == "operation enabled"


def move(device: Device) -> None:
    """Three turns at two turns per second."""
    drive, params = device.drive, device.drive.params
    turn = params.increments_per_turn
    write(device, 0x6081, max(1, round(2 * turn * params.velocity_unit)))
    write(device, 0x6083, max(1, round(5 * turn * params.acceleration_unit)))
    write(device, 0x6084, max(1, round(5 * turn * params.acceleration_unit)))
    write(device, 0x6082, 0)  # one comes with an end velocity
    for subindex in (1, 2):
        write(device, 0x607D, 0, subindex)  # some come with narrow software limits
    speed = drive.settings.profile_velocity / params.velocity_unit  # one allows only slow ones
    target = drive.position + round(min(3 * turn, 2 * speed))
    drive.target_position = target
    drive.controlword = 0x1F
    run(device, 0.02)
    assert drive.statusword & 0x1000
    drive.controlword = 0x0F
    for _ in range(3_000):
        device.step(0.01)
        if drive.position_demand == target and drive.velocity == 0 and drive.statusword & 0x0400:
            break
    assert state(drive.statusword) == "operation enabled"
    assert drive.position == target
    assert drive.statusword & 0x0400


@pytest.mark.skipif(not corpus_files(), reason="the collection of makers' files is not here")
def test_every_makers_file_makes_a_drive_that_is_enabled_and_moves():
    moved, enabled, failed = 0, 0, []
    for file in corpus_files():
        device = device_from_eds(eds.load(file), 5)
        device.power_on()
        if not device.dictionary.has(0x6040):
            continue
        can_move = 1 in device.drive.modes and device.dictionary.has(0x607A) and device.dictionary.has(0x6083)
        try:
            enable(device, 1 if can_move else 0)
            enabled += 1
            if can_move:
                move(device)
                moved += 1
        except AssertionError as error:
            failed.append(f"{file.name}: 0x{device.drive.error_code:04X} {str(error).splitlines()[0]}")
    assert failed == []
    assert enabled >= 70
    assert moved >= 60


@pytest.mark.parametrize("file", BUILTIN, ids=lambda file: file.stem)
def test_the_built_in_files_make_drives_that_move(file):
    device = device_from_eds(eds.load(file), 5)
    device.power_on()
    write(device, 0x605A, 2)
    enable(device, 1)
    move(device)


def test_the_reference_drive_shows_its_makers_error_bits():
    device = device_from_eds(eds.load(CHECKOUT / "eds" / "gim6010-8.eds"), 5)
    device.power_on()
    device.drive.fault(0xFF00, maker_bits=0x3_0000_0040)
    assert device.read(0x203F) == 0x0000_0040
    assert device.read(0x203E) == 3
    assert device.read(0x603F) == 0xFF00
    assert device.read(0x1001) == 0x81


def test_the_reference_drive_has_the_modes_of_its_objects_not_of_its_6502():
    file = CHECKOUT / "eds" / "gim6010-8.eds"
    assert {1, 3, 4, 6, 8} <= modes_of(eds.load(file))
    assert device_from_eds(eds.load(file), 3).read(0x6502) == 0x761
