"""Files: found or not, EDS or not, read once, and the two that come with the library."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest

from axisbus.eds import canopen_text, load, loads
from axisbus.eds.builtin import names, resolve
from axisbus.errors import EdsError, UserError
from kit.eds.texts import HEAD

PNG = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x02\x00" + bytes(range(256)) * 40


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (PNG, "PNG"),
        (b"", "empty"),
        (b" \r\n\t", "empty"),
        (b"%PDF-1.7\nstuff", "PDF"),
        (b'<?xml version="1.0"?>\n<ISO15745ProfileContainer/>', "XDD"),
        (b"import can\nprint('hello')\n", "import can"),
        (b"[tool.ruff]\nline-length = 110\n", "tool.ruff"),
        (random.Random(7).randbytes(200_000), "not an EDS"),
        (b"\0" * 4_000_000, "binary"),
        (b"[" * 1_000_000, "not an EDS"),
        (b"\n" * 8_000_000, "empty"),
        (b" " * 4_000_000 + b"x", "not an EDS"),
        (b"[DeviceInfo]\nVendorName=nobody\n", "no object"),
    ],
    ids=["png", "empty", "blank", "pdf", "xml", "python", "toml", "noise", "zeros", "brackets", "newlines", "spaces", "hull"],
)  # fmt: skip
def test_a_file_that_is_no_eds_is_one_error_with_the_reason(data: bytes, words: str) -> None:
    start = time.process_time()
    with pytest.raises(EdsError) as caught:
        loads(data, "drive.eds")
    assert words in str(caught.value)
    assert str(caught.value).startswith("drive.eds: ")
    assert caught.value.remedy
    assert time.process_time() - start < 1.0


@pytest.mark.parametrize(
    "body",
    [
        "ParameterName=A"
        + " " * 500_000
        + "B\nDataType=7\nAccessType=rw\nDefaultValue=1"
        + " " * 500_000
        + "2\n",
        "ParameterName=A\nDataType=7\nAccessType=rw\nDefaultValue=" + "9" * 1_000_000 + "\n",
        "ParameterName=A\nObjectType=8\nCompactSubObj=3\nDataType=7\nAccessType=rw\n[2000Value]\n"
        + "".join(f"{number}=x\n" for number in range(50_000)),
        "".join(f"[{number:04X}sub1]\n" for number in range(0x2000, 0x9FFF)),
    ],
    ids=["gap", "digits", "list", "orphans"],
)
def test_a_monstrous_file_is_read_in_bounded_time(body: str) -> None:
    start = time.process_time()
    eds = loads((HEAD + "[2000]\n" + body).encode(), "monster.eds")
    assert canopen_text(eds)
    assert time.process_time() - start < 5.0


def test_a_hundred_megabytes_are_refused_without_being_read(tmp_path: Path) -> None:
    huge = tmp_path / "huge.eds"
    with huge.open("wb") as stream:
        stream.truncate(100 * 1024 * 1024)
    start = time.process_time()
    with pytest.raises(EdsError, match="too large for an EDS: 100 MiB"):
        load(huge)
    assert time.process_time() - start < 0.5


def test_a_missing_file_names_the_nearest_ones(tmp_path: Path) -> None:
    for name in ("gim6010.eds", "other.dcf", "notes.txt"):
        (tmp_path / name).write_text(HEAD)
    with pytest.raises(EdsError) as caught:
        load(tmp_path / "gim6011.eds")
    assert str(tmp_path / "gim6011.eds") in caught.value.message
    assert "gim6010.eds" in caught.value.remedy
    assert "notes.txt" not in caught.value.remedy
    assert isinstance(caught.value, UserError)


def test_a_missing_file_without_a_similar_one_is_reported(tmp_path: Path) -> None:
    with pytest.raises(EdsError, match="there is no EDS or DCF in"):
        load(tmp_path / "x.eds")
    with pytest.raises(EdsError, match="there is no folder"):
        load(tmp_path / "nowhere" / "x.eds")


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "a.eds").write_text(HEAD)
    with pytest.raises(EdsError, match="folder") as caught:
        load(tmp_path)
    assert "a.eds" in caught.value.remedy


@pytest.mark.parametrize("path", ["/dev/null", "a\0b.eds"])
def test_odd_paths_are_refused(path: str) -> None:
    with pytest.raises(EdsError):
        load(path)


def test_files_with_the_same_content_are_parsed_once(tmp_path: Path) -> None:
    first, second = tmp_path / "a.eds", tmp_path / "b.eds"
    first.write_text(HEAD + "; one of its kind\n")
    second.write_text(HEAD + "; one of its kind\n")
    one, again, other = load(first), load(first), load(second)
    assert one.objects is again.objects
    assert one.objects is other.objects
    assert (one.source, other.source) == (str(first), str(second))


def test_changed_content_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "a.eds"
    path.write_text(HEAD)
    before = load(path)
    path.write_text(HEAD.replace("Device type", "Something else"))
    assert before.objects[0x1000].name == "Device type"
    assert load(path).objects[0x1000].name == "Something else"


def test_builtin_files_are_found_by_name() -> None:
    assert {"gim6010-8", "generic-cia402"} <= set(names())
    for name in names():
        assert load(resolve(f"builtin:{name}", Path("/nowhere"))).objects


def test_an_unknown_builtin_name_lists_the_known_ones() -> None:
    with pytest.raises(EdsError) as caught:
        resolve("builtin:gim6010", Path())
    assert "builtin:generic-cia402" in caught.value.observed
    assert "did you mean builtin:gim6010-8?" in caught.value.remedy


def test_a_path_is_relative_to_the_folder_of_the_cell_file(tmp_path: Path) -> None:
    assert resolve("eds/x.eds", tmp_path) == tmp_path / "eds" / "x.eds"
    assert resolve("/abs/x.eds", tmp_path) == Path("/abs/x.eds")
