"""Files that are small and say much, or large and say nothing: they are read in the time and memory that their text takes."""

from __future__ import annotations

import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from axisbus import eds
from axisbus.cli.main import cli
from axisbus.cli.shared.common import run
from axisbus.eds import dcf, fix
from axisbus.eds.io import compact, reader
from axisbus.errors import EdsError
from kit.eds.texts import HEAD, read, variable

SOME_SECONDS = 6.0  # of the processor, on a slow machine; an algorithm that is not linear takes minutes
COMPACT = variable("2000", ObjectType="0x8", DataType="0x0007", PDOMapping="0", CompactSubObj="254")


def compact_objects(count: int, body: str = "") -> str:
    """Return a file of so many objects of 254 compact sub-indices each."""
    text = COMPACT + body
    return HEAD + "".join(text.replace("[2000", f"[{index:04X}") for index in range(0x2000, 0x2000 + count))


def spent(work: Callable[[], object]) -> float:
    """Return the seconds of the processor that something takes."""
    start = time.process_time()
    work()
    return time.process_time() - start


def check(text: str) -> tuple[eds.EdsFinding, ...]:
    """Check a text by all rules."""
    return eds.check(reader.read(text.encode(), "big.eds"))


@pytest.mark.parametrize("body", ["", "[2000Value]\nNrOfEntries=1\n1=3\n"])
def test_compact_objects_are_checked_without_making_their_sub_indices(body: str) -> None:
    text = compact_objects(4000, body)  # a million sub-indices
    assert spent(lambda: check(text)) < SOME_SECONDS
    reading = reader.read(text.encode(), "big.eds")
    tracemalloc.start()
    try:
        eds.check(reading)
        assert tracemalloc.get_traced_memory()[1] < 60e6
    finally:
        tracemalloc.stop()


def test_one_entry_of_another_type_among_compact_ones_is_found_on_that_entry() -> None:
    odd = "[2000sub7]\nParameterName=Odd\nObjectType=0x7\nDataType=0x0005\nAccessType=rw\nPDOMapping=0\n"
    (found,) = [each for each in check(compact_objects(1, odd)) if each.rule == "O026"]
    assert (found.index, found.subindex) == (0x2000, 7)
    again = odd + odd.replace("sub7", "sub8") + odd.replace("sub7", "sub9")
    (found,) = [each for each in check(compact_objects(1, again)) if each.rule == "O026"]
    assert found.subindex == 7  # the copies are more, though only one of them is made


def test_compact_entries_are_equal_at_each_access_and_counted_if_alike() -> None:
    subs = read(compact_objects(1).removeprefix(HEAD)).objects[0x2000].subs
    assert subs[5] == subs[5]
    assert (len(subs), 254 in subs, 255 in subs) == (255, True, False)
    assert [many for _, many in compact.grouped(subs)] == [1, 254]


NOISE = {
    "lines without an equals sign": "hello world, this is no entry\n" * 400_000,
    "different lines without one": "".join(f"line {number:x} of nothing\n" for number in range(400_000)),
    "one long comment": ";" + "a" * 14_000_000 + "\n",
    "comments with signs": ";" + " a=b ;" * 2_000_000 + "\n",
    "many comments": "; a comment of one line\n" * 400_000,
    "keys of nobody": "".join(f"key{number}=1\n" for number in range(100_000)),
    "one section again and again": "[2FFF]\n" + "ParameterName=x\n" * 1000 + "[2FFF]\n" * 50_000,
}


@pytest.mark.parametrize("kind", NOISE)
def test_megabytes_of_noise_are_checked_and_fixed_in_the_time_of_their_text(kind: str) -> None:
    text = HEAD + NOISE[kind]
    assert spent(lambda: check(text)) < SOME_SECONDS
    assert spent(lambda: fix.fix(reader.read(text.encode(), "big.eds"))) < SOME_SECONDS


def test_lines_that_all_change_are_still_reported_by_their_own_numbers() -> None:
    lines = "".join(
        f" [{index:04X}]\nParameterName=x\nDataType=7 ; what\n" for index in range(0x2000, 0x5000)
    )
    assert spent(lambda: fix.fix(reader.read((HEAD + lines).encode(), "big.eds"))) < SOME_SECONDS


def test_more_lines_than_any_eds_has_are_refused() -> None:
    with pytest.raises(EdsError, match="too many lines for an EDS"):
        reader.read((HEAD + "\n" * (reader.MAX_LINES + 1)).encode(), "big.eds")


@pytest.mark.parametrize("command", ["show", "doc", "code", "export"])
def test_commands_that_list_every_entry_refuse_more_than_any_device_has(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "big.eds"
    path.write_text(compact_objects(500))
    options = {"show": [], "export": ["--csv"]}.get(command, ["-o", str(tmp_path / "out.py")])
    monkeypatch.setattr(sys, "argv", ["axisbus", "eds", command, str(path), *options])
    assert run(cli) == 1
    assert "more entries than any device has" in capsys.readouterr().err
    assert not (tmp_path / "out.py").exists()


def test_a_dcf_of_compact_objects_does_not_make_them_all() -> None:
    made = eds.loads(compact_objects(4000).encode(), "big.eds")
    assert spent(lambda: dcf.differing(made, 5)) < SOME_SECONDS
