"""The file of a node's program: Intel HEX and S-record typed by hand, gaps, damaged files, and files as they are."""

from __future__ import annotations

import zlib
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.configuration import program_image
from axisbus.configuration.program_image import read_image
from axisbus.errors import UserError

# 8 bytes from 08004000h in two records; checksums by hand: the sum of all bytes of a record is 0 modulo 256.
HEX = ":020000040800F2\n:0440000001020304B2\n:04400400050607089E\n:00000001FF\n"
GAP = ":0440000001020304B2\n:04400800050607089A\n:00000001FF\n"  # 4008h instead of 4004h
# The same 8 bytes in one record with a 32-bit address; its checksum makes the sum of all bytes FFh.
SREC = "S00600004844521B\nS30D08004000010203040506070886\nS70508004000B2\n"
DATA = bytes(range(1, 9))


@pytest.fixture
def file(tmp_path):
    def make(content: str | bytes) -> Path:
        path = tmp_path / "firmware"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return make


def refused(path: Path, **options) -> UserError:
    with pytest.raises(UserError) as caught:
        read_image(path, **options)
    return caught.value


@pytest.mark.parametrize(
    "content", [HEX, HEX.replace("\n", "\r\n"), SREC], ids=["hex", "hex of Windows", "srec"]
)
def test_the_bytes_of_a_file_with_addresses_are_read(file, content):
    image = read_image(file(content))
    assert (image.data, image.first, image.filled) == (DATA, 0x0800_4000, 0)


def test_records_in_another_order_are_the_same_program(file):
    head, first, second, end = HEX.splitlines()
    assert read_image(file("\n".join([head, second, first, end]))).data == DATA


def test_an_image_in_words_has_its_address_and_checksum(file):
    crc = zlib.crc32(DATA)
    assert str(read_image(file(HEX))) == f"Intel HEX, 8 bytes from address 8004000h, CRC-32 {crc:08X}h"


def test_a_binary_file_is_only_taken_as_it_is(file):
    path = file(b"\x7fELF" + DATA)
    error = refused(path)
    assert "neither Intel HEX nor S-record" in error.message
    assert "--raw" in error.remedy
    assert read_image(path, raw=True).data == b"\x7fELF" + DATA


def test_with_raw_even_a_hex_file_is_taken_as_it_is(file):
    assert read_image(file(HEX), raw=True).data == HEX.encode()


# -- gaps and addresses ----------------------------------------------------------------------------------------------------


def test_a_gap_is_refused_without_a_byte_for_it(file):
    error = refused(file(GAP))
    assert "1 gap, 4 bytes in all" in error.message
    assert "from 4004h to 4007h" in error.observed
    assert "--fill 0xFF" in error.remedy


@pytest.mark.parametrize("byte", [0x00, 0xFF])
def test_a_gap_is_filled_with_the_given_byte(file, byte):
    image = read_image(file(GAP), fill=byte)
    assert image.data == DATA[:4] + bytes([byte] * 4) + DATA[4:]
    assert image.filled == 4
    assert "4 of them filled in" in str(image)


def test_a_start_before_the_first_record_is_a_gap(file):
    assert "from 8003FFEh to 8003FFFh" in refused(file(HEX), start=0x0800_3FFE).observed
    image = read_image(file(HEX), start=0x0800_3FFE, fill=0xFF)
    assert (image.data, image.first) == (b"\xff\xff" + DATA, 0x0800_3FFE)


def test_data_before_the_start_are_refused(file):
    error = refused(file(HEX), start=0x0800_4001, fill=0xFF)
    assert "data before the address 8004001h" in error.message
    assert "its first byte is at 8004000h" in error.observed


def test_records_at_distant_addresses_do_not_fill_the_memory(file):
    far = HEX.replace(":00000001FF\n", ":02000004F0000A\n:010000009966\n:00000001FF\n")
    assert "too large" in refused(file(far), fill=0xFF).message


# -- damaged files ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (HEX.replace("B2", "B3"), 2),
        (HEX.replace("9E", "9G"), 3),
        (HEX.replace(":04400400", ":05400400"), 3),
        (HEX.replace(":0440000001020304B2", "hello"), 2),
        (SREC.replace("S30D", "S30C"), 2),
        (SREC.replace("0886\n", "0887\n"), 2),
        (HEX + ":0440000001020304B2\n", 5),
    ],
    ids=["checksum", "no digit", "length", "text", "srec length", "srec checksum", "after the end"],
)
def test_a_damaged_record_is_refused_with_its_line(file, content, line):
    path = file(content)
    assert f"{path}:{line}: " in refused(path).message


@pytest.mark.parametrize("content", [HEX, SREC], ids=["hex", "srec"])
def test_a_file_that_was_cut_off_is_refused_at_every_line(file, content):
    lines = content.splitlines()
    for count in range(1, len(lines)):
        assert "was cut off" in refused(file("\n".join(lines[:count]) + "\n")).message


def test_two_records_with_the_same_address_are_refused(file):
    twice = HEX.replace(":00000001FF\n", ":0440000001020304B2\n:00000001FF\n")
    assert "not a valid Intel HEX file" in refused(file(twice)).message


@pytest.mark.parametrize("content", ["", " \n\n"], ids=["empty", "blank"])
@pytest.mark.parametrize("raw", [False, True])
def test_an_empty_file_is_refused(file, content, raw):
    assert "is empty" in refused(file(content), raw=raw).message


def test_a_file_without_data_is_refused(file):
    assert "contains no data" in refused(file(":00000001FF\n")).message


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    for path in (tmp_path / "none", tmp_path):
        assert "cannot be read" in refused(path).message


def test_a_huge_file_is_refused_before_it_is_read(file, monkeypatch):
    monkeypatch.setattr(program_image, "LARGEST", 4)
    assert "too large" in refused(file(b"x" * 33), raw=True).message


@given(st.text(alphabet=":S0123456789ABCDEF\n gZ", max_size=80).map(lambda text: ":" + text))
def test_any_text_is_read_or_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("any") / "firmware.hex"
    for content in (text, "S1" + text):
        path.write_text(content)
        with suppress(UserError):  # and no other error
            assert read_image(path, fill=0).data


def test_without_bincopy_the_extra_is_named(file, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    assert 'pip install "axisbus[program]"' in refused(file(HEX)).remedy
    assert read_image(file(HEX), raw=True).data == HEX.encode()
