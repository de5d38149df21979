"""LSS frames and tables, byte by byte as CiA 305 prints them."""

from __future__ import annotations

import pytest

from axisbus.cia305 import services
from axisbus.cia305.services import LssAddress, LssService, LssState
from axisbus.errors import ArgumentError

ADDRESS = LssAddress(0x11223344, 0x55667788, 0x99AABBCC, 0xDDEEFF00)


@pytest.mark.parametrize(
    ("frame", "digits"),
    [
        (services.switch_global(LssState.WAITING), "04 00 00 00 00 00 00 00"),
        (services.switch_global(LssState.CONFIGURATION), "04 01 00 00 00 00 00 00"),
        (services.configure_node_id(5), "11 05 00 00 00 00 00 00"),
        (services.configure_node_id(255), "11 FF 00 00 00 00 00 00"),
        (services.configure_bit_timing(2), "13 00 02 00 00 00 00 00"),
        (services.configure_bit_timing(7, table=128), "13 80 07 00 00 00 00 00"),
        (services.activate_bit_timing(1.0), "15 E8 03 00 00 00 00 00"),
        (services.activate_bit_timing(65.535), "15 FF FF 00 00 00 00 00"),
        (services.store_configuration(), "17 00 00 00 00 00 00 00"),
        (services.identify_non_configured(), "4C 00 00 00 00 00 00 00"),
        (services.inquire(LssService.INQUIRE_VENDOR_ID), "5A 00 00 00 00 00 00 00"),
        (services.inquire(LssService.INQUIRE_NODE_ID), "5E 00 00 00 00 00 00 00"),
        (services.fastscan(0, 0x80, 0, 0), "51 00 00 00 00 80 00 00"),
        (services.fastscan(0x11223344, 31, 3, 0), "51 44 33 22 11 1F 03 00"),
    ],
)
def test_a_frame(frame: bytes, digits: str) -> None:
    assert frame == bytes.fromhex(digits)


def test_selective_switching_is_four_frames() -> None:
    assert services.switch_selective(ADDRESS) == (
        bytes.fromhex("40 44332211 000000"),
        bytes.fromhex("41 88776655 000000"),
        bytes.fromhex("42 CCBBAA99 000000"),
        bytes.fromhex("43 00FFEEDD 000000"),
    )


def test_identifying_is_six_frames() -> None:
    low = LssAddress(1, 2, 3, 4)
    high = LssAddress(1, 2, 5, 6)
    assert [frame[:2].hex() for frame in services.identify_remote(low, high)] == [
        "4601",
        "4702",
        "4803",
        "4905",
        "4a04",
        "4b06",
    ]


@pytest.mark.parametrize(
    ("bitrate", "index"),
    [
        (1_000_000, 0),
        (800_000, 1),
        (500_000, 2),
        (250_000, 3),
        (125_000, 4),
        (50_000, 6),
        (20_000, 7),
        (10_000, 8),
    ],
)
def test_the_table_of_bit_timings(bitrate: int, index: int) -> None:
    assert services.bit_timing_index(bitrate) == index


def test_a_rate_that_is_reserved_or_unknown_is_refused_with_those_that_are() -> None:
    with pytest.raises(ArgumentError, match="no bit rate of 100000") as caught:
        services.bit_timing_index(100_000)
    assert "125_000" in caught.value.remedy


@pytest.mark.parametrize("node_id", [1, 127, 255])
def test_node_ids_that_can_be_given(node_id: int) -> None:
    services.require_node_id(node_id)


@pytest.mark.parametrize("node_id", [-1, 0, 128, 254, 256])
def test_invalid_node_ids_are_refused(node_id: int) -> None:
    with pytest.raises(ArgumentError, match=f"node-ID {node_id} cannot"):
        services.require_node_id(node_id)


def test_a_number_beyond_32_bits_is_no_address() -> None:
    with pytest.raises(ArgumentError, match="serial number 4294967296"):
        LssAddress(1, 2, 3, 1 << 32)


@pytest.mark.parametrize(
    ("service", "code", "specific", "words"),
    [
        (LssService.CONFIGURE_NODE_ID, 1, 0, "out of range"),
        (LssService.CONFIGURE_BIT_TIMING, 1, 0, "does not support this bit rate"),
        (LssService.STORE_CONFIGURATION, 1, 0, "cannot store"),
        (LssService.STORE_CONFIGURATION, 2, 0, "could not write to its memory"),
        (LssService.STORE_CONFIGURATION, 255, 0x42, "manufacturer-specific error 66 (0x42)"),
        (LssService.CONFIGURE_NODE_ID, 77, 0, "error 77, which CiA 305 reserves"),
    ],
)
def test_error_codes_in_words(service: LssService, code: int, specific: int, words: str) -> None:
    text, remedy = services.refusal(service, code, specific)
    assert words in text
    assert remedy


def test_names_of_services_are_the_standards() -> None:
    assert LssService.CONFIGURE_NODE_ID.text == "configure node-ID"
    assert LssService.INQUIRE_VENDOR_ID.text == "inquire vendor-ID"
    assert LssService.STORE_CONFIGURATION.text == "store configuration"
