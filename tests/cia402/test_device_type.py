"""The device type 1000h as text: used by a scan of the bus and a report about an EDS."""

import pytest

from axisbus.cia402.device_type import device_kind


@pytest.mark.parametrize(
    ("device_type", "words"),
    [
        (None, ""),
        (0x00000000, "no standard profile"),
        (0x00010192, "frequency converter (CiA 402)"),
        (0x00020192, "servo drive (CiA 402)"),
        (0x00040192, "stepper drive (CiA 402)"),
        (0x00060192, "servo drive and stepper drive (CiA 402)"),  # a drive for either motor
        (0x00420192, "servo drive (CiA 402)"),  # bits 19 to 31 are no kind of drive
        (0x00000192, "drive (CiA 402)"),
        (0xFFFF0192, "drive with several axes (CiA 402)"),
        (0x000F0191, "I/O module (CiA 401)"),
        (0x00060912, "device (CiA 2322)"),  # exchanged digits of 0192h
    ],
)
def test_a_device_type_in_words(device_type, words):
    assert device_kind(device_type) == words
