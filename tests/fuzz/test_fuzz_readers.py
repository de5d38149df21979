"""A small part of ``make fuzz``, and tests of its judgement."""

from __future__ import annotations

import pytest

from axisbus.errors import ArgumentError
from kit import reader_limits
from kit.frame_mutations import packed, unpacked
from kit.reader_limits import Limits, Reader, few_mutations, fuzzed, inputs
from kit.readers import READERS


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", READERS)
def test_a_mutated_input_is_read_or_refused_by_its_name(name, tmp_path):
    assert few_mutations(READERS[name], tmp_path, seed=37, count=60) == []


def _raised(error):
    def read(_):
        raise error

    return read


def _hangs(_):
    while True:
        pass


def _hangs_on(_):
    for _ in range(2):
        try:
            _hangs(None)
        except AssertionError:  # like a reader that ignores every error
            return


@pytest.mark.parametrize(
    ("read", "finding"),
    [
        (_raised(ArgumentError("line 3 is wrong")), "does not name where it is wrong: ArgumentError"),
        (_raised(KeyError("x")), "KeyError"),
        (_raised(OSError("disk")), "OSError"),
        (_hangs, "hangs"),
        (_hangs_on, "hangs"),
        (lambda _: sum(range(1_000_000)), "takes 0."),
        (lambda _: bytearray(30 << 20), "takes 30 MB"),
    ],
    ids=["nameless", "another error", "disk", "hangs", "hangs silently", "slow", "memory"],
)
def test_a_fault_of_a_reader_is_found(monkeypatch, tmp_path, read, finding):
    monkeypatch.setattr(reader_limits, "HANGS", 0.3 if read in (_hangs, _hangs_on) else 20.0)
    limits = Limits(seconds=0.005, per_kb=0.0, memory=16 << 20)
    reader = Reader(".x", lambda _: [b""], read, limits=limits)
    found = fuzzed(reader, tmp_path / "input.x", b"x", measured="memory" in finding or "MB" in finding)
    assert found.finding.startswith(finding)


def test_a_refusal_that_names_the_file_is_no_finding(tmp_path):
    path = tmp_path / "input.x"
    reader = Reader(".x", lambda _: [b""], _raised(ArgumentError(f"{path}, line 3: wrong")))
    assert fuzzed(reader, path, b"x") == ("", False)


def test_a_reader_that_refuses_a_valid_input_is_found(tmp_path):
    path = tmp_path / "input.x"
    reader = Reader(".x", lambda _: [b""], _raised(ArgumentError(f"{path}, line 3: wrong")))
    assert (
        few_mutations(reader, tmp_path, seed=1, count=0)
        == ["a valid input is refused: with an error of its own"] * 2
    )


def test_frames_are_lines_of_an_input_and_each_number_makes_the_same_one():
    frames = [b"", b"\0\xff", bytes(range(64))]
    assert unpacked(packed(frames)) == frames
    made = inputs([packed(frames)], 37, reader_limits.mutated)
    assert made(5) == made(5) != made(6)
