"""Drive files: the facts that they give, their errors with lines and remedies, and their JSON Schema."""

from __future__ import annotations

import tomllib
from pathlib import Path

import jsonschema
import pytest

from axisbus.drives import (
    Behaviour,
    DrivePlugin,
    FaultObject,
    FaultTexts,
    MeasuredObject,
    NodeIdObject,
    drive_file,
)
from axisbus.drives.drive_file_schema import ABOUT, schema_of_drive_files
from axisbus.errors import ConfigError
from axisbus.toml.problem import CellProblem
from kit import pages

WHOLE = """\
name = "ACME servo"
vendor_id = 0x123
product_codes = [7, 8]
revisions = [0x10001]
eds_files = ["acme.eds"]
calibration_objects = ["2040h", "2041h:02"]
scale_proposal = "4096 counts per turn"
unread_watchdog = "its watchdog cannot be read"
notes = ["home it after each start"]
sources = ["ACME manual 2.1, section 4"]

[behaviour]
handshake = "on-change"
demand = "ignore"
modes = ["pp", "hm"]
ignored_objects = ["605Dh"]
transition_time = "3s"
mode_time = "2s"
acknowledge_time = "1500ms"
lists_modes = false
store_restarts = true

[errors]
8611h = "following error"
0xFF01 = "fan blocked"

[measured]
voltage = { object = "2201h:01", factor = 0.1 }
current = { object = "6078h", factor = 0.001, relative_to = "6075h" }

[node_id]
object = "2009h"
store = "1010h:02"

[[fault_objects]]
object = "2320h"
[fault_objects.bits]
0 = "fan"
31 = "brake"

[[fault_objects]]
object = "1003h:01"
from_bit = 24
width = 8
[fault_objects.values]
3 = "supply too low"
0x10 = "memory"
"""
MINIMAL = 'name = "ACME"\nvendor_id = 0x123\n'
SCHEMA = schema_of_drive_files()


def written(folder: Path, text: str) -> Path:
    path = folder / "acme.toml"
    path.write_text(text, encoding="utf-8")
    return path


def problems(folder: Path, text: str) -> list[CellProblem]:
    plugin, found = drive_file.read(written(folder, text))
    assert (plugin is None) == bool(found)
    return found


def test_a_file_gives_every_fact_of_a_plug_in(tmp_path: Path) -> None:
    objects = (
        FaultObject(0x2320, 0, {0: "fan", 31: "brake"}),
        FaultObject(0x1003, 1, {}, {3: "supply too low", 16: "memory"}, 24, 8),
    )
    assert drive_file.load(written(tmp_path, WHOLE)) == DrivePlugin(
        name="ACME servo",
        vendor_id=0x123,
        product_codes=frozenset((7, 8)),
        revisions=frozenset((0x10001,)),
        eds_files=(str(tmp_path / "acme.eds"),),
        fault_objects=((0x2320, 0), (0x1003, 1)),
        explain=FaultTexts({0x8611: "following error", 0xFF01: "fan blocked"}, objects),
        calibration_objects=((0x2040, None), (0x2041, 2)),
        scale_proposal="4096 counts per turn",
        measured={
            "voltage": MeasuredObject(0x2201, 1, 0.1),
            "current": MeasuredObject(0x6078, 0, 0.001, of=0x6075),
        },
        behaviour=Behaviour(
            handshake="on-change",
            demand="ignore",
            modes=("pp", "hm"),
            ignored_objects=(0x605D,),
            transition_time=3.0,
            mode_time=2.0,
            acknowledge_time=1.5,
            lists_modes=False,
            store_restarts=True,
        ),
        node_id=NodeIdObject((0x2009, 0), (0x1010, 2)),
        notes=("home it after each start",),
        unread_watchdog="its watchdog cannot be read",
        sources=("ACME manual 2.1, section 4",),
    )


def test_what_a_file_leaves_out_is_as_the_standard_says(tmp_path: Path) -> None:
    plugin = drive_file.load(written(tmp_path, MINIMAL))
    assert plugin.behaviour == Behaviour()
    assert plugin.explain(0x8611, {}) == []
    assert (plugin.product_codes, plugin.fault_objects, plugin.calibration_objects) == (None, (), ())
    assert plugin.node_id is None


def test_bits_and_numbers_of_a_fault_are_explained(tmp_path: Path) -> None:
    explain = drive_file.load(written(tmp_path, WHOLE)).explain
    assert explain(0xFF01, {}) == ["fan blocked"]
    assert explain(0, {(0x2320, 0): 0x8000_0001}) == ["fan [2320h bit 0]", "brake [2320h bit 31]"]
    assert explain(0, {(0x1003, 1): 0x0301_8611}) == ["supply too low [1003h:01 number 3]"]
    assert explain(0x8611, {(0x2320, 0): 0x2, (0x1003, 1): 0x0400_0003}) == ["following error"]


def test_an_object_that_was_not_read_explains_nothing() -> None:
    texts = FaultTexts(objects=(FaultObject(0x2320, values={0: "no supply"}),))
    assert texts(0, {(0x2320, 0): 0}) == ["no supply [2320h number 0]"]
    assert texts(0, {}) == []


@pytest.mark.parametrize(
    ("text", "line", "message", "remedy"),
    [
        ('vendor_id = 1\n', 1, "name is missing in a drive file", 'add name = "ACME servo"'),
        ('name = "ACME"\n', 1, "vendor_id is missing in a drive file", "add vendor_id = 0x123"),
        (MINIMAL + "vendor = 1\n", 3, "unknown key 'vendor' in a drive file", "did you mean vendor_id?"),
        (MINIMAL + "[behaviour]\nhandshak = 1\n", 4, "unknown key 'handshak' in [behaviour]", "did you mean handshake?"),
        (MINIMAL + "handshake = 1\n", 3, "unknown key 'handshake' in a drive file", "it belongs in [behaviour]"),
        (MINIMAL + '[behaviour]\nhandshake = "never"\n', 4, "handshake in [behaviour] cannot be used", "write one of these words"),
        (MINIMAL + '[behaviour]\nmode_time = "700s"\n', 4, "mode_time in [behaviour] cannot be used", '"600s" is the longest'),
        (MINIMAL + '[behaviour]\nignored_objects = ["2000h"]\n', 4, "ignored_objects in [behaviour]", "write 6000h to 67FFh"),
        (MINIMAL.replace("0x123", "0x1_0000_0000"), 2, "vendor_id in a drive file cannot be used", "correct vendor_id"),
        (MINIMAL + "notes = []\n", 3, "notes in a drive file cannot be used", "correct notes"),
        (MINIMAL + '[errors]\n86 = "x"\n', 4, "'86' is not an error code", "write it in four hexadecimal digits"),
        (MINIMAL + "[errors]\n8611h = 5\n", 4, "8611h in [errors] cannot be used", "put it in quotes"),
        (MINIMAL + "[measured]\nspeed = 1\n", 4, "unknown value 'speed' in [measured]", "known names are temperature, voltage"),
        (MINIMAL + '[measured]\nvoltage = { object = "2201h" }\n', 4, "factor is missing in [measured.voltage]", "add factor"),
        (MINIMAL + '[fault_objects]\nobject = "2320h"\n', 3, "fault_objects must be a list of tables", "in double brackets"),
        (MINIMAL + '[[fault_objects]]\nobject = "2320"\nbits = { 32 = "x" }\n', 5, "'32' is not", "write 0 to 31"),
        (MINIMAL + '[[fault_objects]]\nobject = "2320"\nfrom_bit = 24\nwidth = 9\n', 6, "exceed 32 bits", "write width = 8"),
        (MINIMAL + '[[fault_objects]]\nbits = { 0 = "fan" }\n', 3, "object is missing in [fault_objects.0]", "add object"),
        ("name = ACME\n", 1, "this is not TOML", "write a number, true, false"),
    ],
)  # fmt: skip
def test_an_error_has_its_line_and_its_remedy(
    tmp_path: Path, text: str, line: int, message: str, remedy: str
) -> None:
    (problem,) = [each for each in problems(tmp_path, text) if message in each.message]
    assert (problem.file, problem.line) == (str(tmp_path / "acme.toml"), line)
    assert remedy in problem.remedy


def test_all_errors_are_reported_and_loading_raises_the_first(tmp_path: Path) -> None:
    text = MINIMAL + "a = 1\nb = 2\n"
    assert [each.line for each in problems(tmp_path, text)] == [3, 4]
    with pytest.raises(ConfigError, match=r"acme\.toml:3: unknown key 'a'") as caught:
        drive_file.load(tmp_path / "acme.toml")
    assert "unknown key 'b'" in caught.value.observed


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    plugin, (problem,) = drive_file.read(tmp_path / "acme.toml")
    assert plugin is None
    assert problem.message == "the file does not exist"


def test_the_schema_accepts_what_the_reader_accepts() -> None:
    for text in (WHOLE, MINIMAL):
        jsonschema.validate(tomllib.loads(text), SCHEMA)


@pytest.mark.parametrize(
    "more", ["vendor = 1\n", "[behaviour]\nhandshak = 1\n", '[behaviour]\nhandshake = "never"\n', "[errors]\n8611h = 5\n"]
)  # fmt: skip
def test_the_schema_refuses_what_is_wrong(more: str) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(tomllib.loads(MINIMAL + more), SCHEMA)


def test_each_key_has_its_words_in_the_schema() -> None:
    tables = (
        drive_file.TOP,
        drive_file.BEHAVIOUR,
        drive_file.MEASURED,
        drive_file.FAULT_OBJECT,
        drive_file.NODE_ID,
    )
    assert set(ABOUT) == {key for table in tables for key in table}


@pytest.mark.parametrize("text", pages.drive_files())
def test_each_drive_file_of_the_pages_is_valid(tmp_path: Path, text: str) -> None:
    assert problems(tmp_path, text) == []
