"""Real files of many makers, and files of noise: each is checked, nothing stops the check, and findings point into the file."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.eds import Severity, check
from axisbus.eds.io import reader
from axisbus.errors import EdsError
from kit.corpus import CORPUS
from kit.eds.rule_base import BASE

ROOT = Path(__file__).parents[2]
FILES = (
    sorted(path for path in CORPUS.iterdir() if path.suffix in (".eds", ".dcf")) if CORPUS.is_dir() else []
)
# Defects that people found in these files by eye: maker and product, rule, and the location in the file.
SEEN = (
    ("schunk-gmbh-co.-kg__schunk-0-63__ros-industrial", "M001c", 1595),
    ("elmo-motion-control__simpliq", "P002", 1709),
    ("elmo-motion-control__simpliq", "P005", 1069),
    ("schunk__schunk__", "P005", 412),
    ("elmo-motion-control__gold-drive_elmo", "P003", 820),
    ("dunkermotoren", "P003", 2493),
    ("schneider-electric-m__canopen-pvl", "S003", 2894),
    ("maxon-motor-ag__epos-70-10", "S017", 57),
    ("curtis__ac-f2", "O009", 1785),
)


@pytest.mark.skipif(not FILES, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
class TestRealFiles:
    def test_every_file_is_checked_and_findings_point_into_it(self) -> None:
        for path in FILES:
            reading = reader.read(path.read_bytes(), path.name)
            lines = reading.document.lines
            for finding in check(reading):
                assert 0 <= finding.line <= len(lines), (path.name, finding)
                assert finding.message, (path.name, finding)
                assert finding.remedy, (path.name, finding)
                if finding.line:
                    assert 1 <= finding.column <= len(lines[finding.line - 1]) + 1, (path.name, finding)

    @pytest.mark.parametrize(("file", "rule", "line"), SEEN)
    def test_defects_that_were_found_by_reading_are_reported(self, file: str, rule: str, line: int) -> None:
        found = [
            each.line for path in FILES if path.name.startswith(file) for each in check(path, select=rule)
        ]
        if not any(path.name.startswith(file) for path in FILES):
            pytest.skip("the file is not there")
        assert line in found


@pytest.mark.parametrize("path", sorted((ROOT / "eds").glob("*.eds")), ids=lambda path: path.name)
def test_our_own_files_have_nothing_above_a_note(path: Path) -> None:
    assert [each for each in check(path) if each.severity is not Severity.NOTE] == []


def test_the_value_of_6502h_in_a_real_joint_module_s_eds_is_a_note() -> None:
    """6502h of this drive has its bits in another order: it claims ip and cstca, which are not described at all, and not pv, tq."""
    found = {each.rule for each in check(ROOT / "eds" / "gim6010-8.eds")}
    assert {"M008", "M009"} <= found


LINES = BASE.splitlines()
WORDS = (
    "",
    "0",
    "-1",
    "0xFFFFFFFFFF",
    "$NODEID+0x200",
    "0x60640020",
    "abc",
    "ü",
    "9" * 50,
    "0x8",
    "0x9",
    "0x7",
    "0x2",
    "255",
    "1.5",
)


@settings(max_examples=150, deadline=None)
@given(st.randoms(use_true_random=False))
def test_a_file_with_lines_changed_at_random_is_checked(rng: random.Random) -> None:
    lines = list(LINES)
    for _ in range(rng.randint(1, 60)):
        at = rng.randrange(len(lines))
        key, equals, _ = lines[at].partition("=")
        changed = f"{key}{equals}{rng.choice(WORDS)}" if equals else rng.choice(LINES)
        what = rng.randrange(4)
        lines[at : at + 1] = [[changed], [], [lines[at], changed], [lines[at][: rng.randint(0, 9)]]][what]
    try:
        reading = reader.read("\n".join(lines).encode(), "x.eds")
    except EdsError:
        return
    for finding in check(reading):
        assert 0 <= finding.line <= len(lines)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_behind_a_section_are_checked(data: bytes) -> None:
    reading = reader.read(b"[1000]\n" + data, "x.eds")
    assert check(reading)


def test_a_large_file_of_noise_is_checked_in_bounded_time() -> None:
    """Half a megabyte of unknown sections and keys; seconds, not minutes, on a busy machine."""
    rng = random.Random(7)
    noise = "".join(
        f"[{rng.randrange(0x1000, 0xFFFF):04x}]\n{rng.randbytes(6).hex()}key=1\nDataTyp{rng.randrange(99)}=5\n"
        for _ in range(12_000)
    )
    start = time.process_time()
    found = check(reader.read(noise.encode(), "noise.eds"))
    assert time.process_time() - start < 15
    assert len(found) < 50_000
