"""``axisbus eds fix`` and ``axisbus eds dcf``: the output, the written files, and the exit codes."""

import json
import re
import stat

import pytest

from axisbus.eds import builtin

EDS = """[FileInfo]
FileName=a.eds
[DeviceInfo]
BaudRate_500=1
BaudRate_1000=0
[MandatoryObjects]
SupportedObjects=3
1=0x1000
[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
[6081]
ParameterName=Profile velocity
DataType=0x0007
AccessType=rw
DefaultValue=10
HighLimit=5000
"""


@pytest.fixture
def eds(tmp_path):
    path = tmp_path / "a.eds"
    path.write_text(EDS)
    return path


def test_fix_shows_a_diff_and_writes_nothing(axisbus, eds):
    code, out, _ = axisbus("eds", "fix", eds)
    assert code == 1
    assert "-SupportedObjects=3\n+SupportedObjects=1\n" in out
    assert f"{eds}: 1 fix (L003 1), not written\nnext: axisbus eds fix {eds} --write" in out
    assert eds.read_text() == EDS


def test_fix_writes_with_the_write_option_and_has_nothing_to_do_the_second_time(axisbus, eds):
    eds.chmod(0o640)
    code, out, _ = axisbus("eds", "fix", eds, "--write")
    assert code == 0
    assert f"{eds}: written with 1 fix (L003 1)\nnext: axisbus eds check {eds}" in out
    assert eds.read_text() == EDS.replace("Objects=3", "Objects=1")
    assert stat.S_IMODE(eds.stat().st_mode) == 0o640
    code, out, _ = axisbus("eds", "fix", eds, "--write")
    assert (code, out) == (0, f"{eds}: nothing to fix\nnext: axisbus eds check {eds}\n")
    assert [path.name for path in eds.parent.iterdir()] == ["a.eds"]


def test_fix_writes_elsewhere(axisbus, eds, tmp_path):
    code, _, _ = axisbus("eds", "fix", eds, "-o", tmp_path / "b.eds")
    assert code == 0
    assert (tmp_path / "b.eds").read_text() == EDS.replace("Objects=3", "Objects=1")
    assert eds.read_text() == EDS


def test_fix_as_json(axisbus, eds):
    code, out, _ = axisbus("eds", "fix", eds, "--json")
    what = "[MandatoryObjects] SupportedObjects 3 -> 1"
    assert code == 1
    assert json.loads(out) == {
        "file": str(eds),
        "written": None,
        "mended": [{"rule": "L003", "line": 7, "what": what}],
    }


def test_fix_repairs_all_readable_files_of_several(axisbus, eds, tmp_path):
    other, clean, broken = tmp_path / "b.eds", tmp_path / "c.eds", tmp_path / "d.eds"
    other.write_text(EDS)
    clean.write_text(EDS.replace("Objects=3", "Objects=1"))
    code, out, _ = axisbus("eds", "fix", eds, tmp_path / "[bc].eds", eds)
    assert code == 1
    assert out.count("-SupportedObjects=3\n+SupportedObjects=1\n") == 2
    assert f"{clean}: nothing to fix\nnext: axisbus eds fix {eds} {other} --write\n" in out
    broken.write_bytes(b"\x89PNG\r\n")
    code, out, err = axisbus("eds", "fix", tmp_path / "*.eds", "--write", "--json")
    assert (code, "it looks like a PNG picture" in err) == (2, True)
    found = {each["file"]: len(each["mended"]) for each in json.loads(out)["files"]}
    assert found == {str(eds): 1, str(other): 1, str(clean): 0}
    assert eds.read_text() == other.read_text() == clean.read_text()


@pytest.mark.parametrize("wrong", [[], ["-o", "x.eds", "--write"], ["b.eds", "-o", "x.eds"]])
def test_fix_with_invalid_arguments_changes_nothing(axisbus, eds, tmp_path, monkeypatch, wrong):
    monkeypatch.chdir(tmp_path)
    code, _, err = axisbus("eds", "fix", *([eds] if wrong else []), *wrong)
    assert (code, eds.read_text()) == (2, EDS)
    assert "-o is for one file" in err if wrong else "no file is given" in err
    assert [path.name for path in tmp_path.iterdir()] == ["a.eds"]


def test_fix_through_a_link_repairs_its_target(axisbus, eds, tmp_path):
    link = tmp_path / "link.eds"
    link.symlink_to(eds)
    assert axisbus("eds", "fix", link, "--write")[0] == 0
    assert link.is_symlink()
    assert "SupportedObjects=1" in eds.read_text()


def test_an_unwritable_file_is_reported_and_nothing_is_left_behind(axisbus, eds, tmp_path):
    code, _, err = axisbus("eds", "fix", eds, "-o", tmp_path / "a.eds" / "b.eds")
    assert code == 1
    assert "b.eds cannot be written" in err
    assert [path.name for path in tmp_path.iterdir()] == ["a.eds"]


def test_fix_of_a_file_that_is_no_eds_is_refused(axisbus, tmp_path):
    path = tmp_path / "x.eds"
    path.write_bytes(b"\x89PNG\r\n")
    code, _, err = axisbus("eds", "fix", path)
    assert code == 2
    assert "it looks like a PNG picture" in err


def test_dcf_and_back(axisbus, eds, tmp_path):
    made, concise, again = tmp_path / "x.dcf", tmp_path / "x.bin", tmp_path / "again.eds"
    code, out, _ = axisbus(
        "eds",
        "dcf",
        eds,
        "--node",
        5,
        "--set",
        "Profile velocity=1000",
        "--baudrate",
        500,
        "-o",
        made,
        "--concise",
        concise,
    )
    assert code == 0
    assert f"{made}: node 5, 1 value differs" in out
    assert f"{concise}: 1 write, 15 octets for 1F22h:05" in out
    assert f"next: axisbus eds check {made}" in out
    assert concise.read_bytes() == bytes.fromhex("01000000 8160 00 04000000 e8030000")
    code, out, _ = axisbus("eds", "dcf", made, "--values")
    assert code == 0
    assert out.splitlines() == [
        "0x6081=1000  Profile velocity (default 10)",
        "1 value differs from the defaults for node 5",
    ]
    code, out, _ = axisbus("eds", "dcf", eds, "--node", 5, "--from-concise", concise, "--values", "--json")
    assert json.loads(out)["values"] == [
        {"object": "0x6081", "name": "Profile velocity", "value": "1000", "default": "10"}
    ]
    assert axisbus("eds", "dcf", made, "--to-eds", "-o", again)[0] == 0
    assert again.read_text() == EDS.replace("a.eds", "again.eds")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["-o", "x.dcf"], 2, "give --node 5"),
        (["--node", "5"], 2, "give -o FILE.dcf"),
        (["--node", "200", "-o", "x.dcf"], 2, "200 is not in the range 1<=x<=127"),
        (["--node", "5", "-o", "x.dcf", "--set", "6081"], 2, "has no '='"),
        (["--node", "5", "-o", "x.dcf", "--set", "6081=5001"], 2, "5001 is outside its limits"),
        (["--node", "5", "-o", "x.dcf", "--set", "1000=1"], 2, "1000h:00 (Device type) cannot be written"),
        (["--node", "5", "-o", "x.dcf", "--set", "6082=1"], 2, "has no object 6082h:00"),
        (["--node", "5", "-o", "x.dcf", "--baudrate", "1000"], 1, "does not support 1000 kbit/s"),
        (["--node", "5", "-o", "x.dcf", "--from-concise", "no.bin"], 1, "the file does not exist"),
        (["--to-eds"], 2, "--to-eds needs -o"),
    ],
)
def test_dcf_that_cannot_be_is_refused_and_nothing_written(
    axisbus, eds, tmp_path, monkeypatch, arguments, code, words
):
    monkeypatch.chdir(tmp_path)
    found, _, err = axisbus("eds", "dcf", eds, *arguments)
    assert found == code
    assert words in err
    assert [path.name for path in tmp_path.iterdir()] == ["a.eds"]


def test_of_many_files_a_hint_names_the_first(axisbus, tmp_path):
    for number in range(8):
        (tmp_path / f"f{number}.eds").write_text(EDS)
    _, out, _ = axisbus("eds", "fix", tmp_path / "f*.eds")
    assert f"{tmp_path / 'f4.eds'} ... --write\n" in out
    assert f"{tmp_path / 'f5.eds'} ..." not in out


def test_the_built_in_files_are_listed_by_the_names_that_a_cell_file_takes(axisbus):
    code, out, _ = axisbus("eds", "list")
    assert code == 0
    assert re.search(r"^builtin:gim6010-8 +GIM6010-8", out, re.MULTILINE)
    rows = json.loads(axisbus("eds", "list", "--json")[1])["files"]
    assert [each["name"] for each in rows] == [f"builtin:{name}" for name in builtin.names()]
