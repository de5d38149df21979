"""Whether nodes, axes, groups and their files fit together; each cell has just one defect."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.check.run import check
from kit import cells


def test_the_clean_cell_has_neither_error_nor_warning(tmp_path: Path) -> None:
    assert cells.serious(cells.write(tmp_path)) == []


def test_findings_are_in_the_order_of_the_lines_with_the_worst_of_a_line_first(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path, ("master_id = 127", "master_id = 2"), ('axes = ["x", "y"]', 'axes = ["x", "z"]')
    )
    found = check(path)
    assert [problem.line for problem in found] == sorted(problem.line for problem in found)
    assert [problem.severity.value for problem in cells.serious(path)] == ["error", "error"]


def test_a_file_that_is_no_toml_is_one_problem(tmp_path: Path) -> None:
    problem = cells.only(cells.write(tmp_path, ('"4ms"', "4ms")), "error", "4ms")
    assert 'scan_period = "4ms"' in problem.remedy


def test_slips_and_contradictions_are_reported_together(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("sync = true", "sink = true"), ("velocity = 100.0", "velocity = 300.0"))
    assert [problem.line for problem in cells.serious(path)] == [
        cells.line_of(path, "sink = true"),
        cells.line_of(path, "velocity = 300.0"),
    ]


# -- references ------------------------------------------------------------------------------------------------------


def test_the_masters_own_id_must_be_unique(tmp_path: Path) -> None:
    problem = cells.only(
        cells.write(tmp_path, ("master_id = 127", "master_id = 2")), "error", "master_id = 2"
    )
    assert "master_id 2 is the node ID of [nodes.2] at line 20" in problem.message
    assert "master_id = 127" in problem.remedy


def test_the_default_id_of_the_master_must_be_unique(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path, ("master_id = 127\n", ""), ("[nodes.2]", "[nodes.127]"), ("node = 2", "node = 127")
    )
    problem = cells.only(path, "error", "[nodes.127]")
    assert "without master_id it is 127" in problem.observed
    assert "master_id = 126" in problem.remedy


def test_a_core_in_its_own_process_needs_a_bus_that_other_processes_can_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    own = ("[bus]\n", '[bus]\nprocess = "own"\n')
    assert cells.serious(cells.write(tmp_path, own)) == []
    path = cells.write(tmp_path, own, ('interface = "pcan"', 'interface = "virtual"'))
    problem = cells.only(path, "error", 'process = "own"')
    assert "virtual" in problem.observed
    assert 'process = "thread"' in problem.remedy


def test_a_core_in_its_own_process_needs_linux(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "win32")
    problem = cells.only(
        cells.write(tmp_path, ("[bus]\n", '[bus]\nprocess = "own"\n')), "error", 'process = "own"'
    )
    assert "win32" in problem.observed


def test_an_axis_needs_its_node(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("node = 2", "node = 3"))
    problem = cells.only(path, "error", "node = 3")
    assert "axis y is on node 3, which the cell does not have" in problem.message
    assert "nodes of the cell: 1, 2" in problem.observed
    assert "[nodes.3]" in problem.remedy


def test_a_node_without_an_axis_is_noted(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("[axes.x]", '[nodes.3]\neds = "drive.eds"\n[axes.x]'))
    assert cells.serious(path) == []
    assert cells.note(path, "node 3 has no axis").line == cells.line_of(path, "[nodes.3]")


def test_two_axes_are_not_the_same_axis_of_one_drive(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("node = 2", "node = 1"))
    (problem,) = cells.serious(path)
    assert problem.severity.value == "error"
    assert problem.line == cells.line_of(path, "[axes.y]") + 1
    assert "axes x and y are the same: axis 1 of node 1" in problem.message
    assert "drive_axis = 2" in problem.remedy


def test_a_groups_axes_are_there(tmp_path: Path) -> None:
    problem = cells.only(cells.write(tmp_path, ('["x", "y"]', '["x", "y", "xx"]')), "error", '"xx"')
    assert "group xy has the axis 'xx', which the cell does not have" in problem.message
    assert "axes of the cell: x, y" in problem.observed
    assert "did you mean 'x'?" in problem.remedy


def test_a_group_has_each_axis_once(tmp_path: Path) -> None:
    problem = cells.only(cells.write(tmp_path, ('["x", "y"]', '["x", "y", "x"]')), "error", '["x", "y", "x"]')
    assert "group xy has the axis 'x' more than once" in problem.message


def test_an_axis_outside_the_groups_is_noted_because_its_fault_stops_everything(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('["x", "y"]', '["x"]'))
    assert "stop the whole cell" in cells.note(path, "axis y is in no group").observed
    assert cells.serious(path) == []


def test_an_axis_and_a_group_do_not_share_a_name(tmp_path: Path) -> None:
    problem = cells.only(cells.write(tmp_path, ("[groups.xy]", "[groups.x]")), "error", "[groups.x]")
    assert "'x' names both an axis and a group" in problem.message


# -- EDS and DCF -----------------------------------------------------------------------------------------------------


def test_a_missing_eds_names_the_files_that_are_there(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('[nodes.2]\neds = "drive.eds"', '[nodes.2]\neds = "drve.eds"'))
    problem = cells.only(path, "error", "drve.eds")
    assert "node 2: its eds 'drve.eds' cannot be used" in problem.message
    assert str(tmp_path / "drve.eds") in problem.observed
    assert "does not exist" in problem.observed
    assert "drive.eds" in problem.remedy


def test_an_eds_that_serves_several_nodes_is_reported_once(tmp_path: Path) -> None:
    path = cells.write(tmp_path)
    (tmp_path / "drive.eds").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    (problem,) = cells.serious(path)
    assert "node 1: its eds 'drive.eds' cannot be used (also of node 2)" in problem.message
    assert "PNG" in problem.observed


def test_an_unknown_built_in_file_names_the_known_ones(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('[nodes.2]\neds = "drive.eds"', '[nodes.2]\neds = "builtin:gim6010"'))
    problem = cells.only(path, "error", "builtin:gim6010")
    assert "builtin:gim6010-8" in problem.remedy


def test_defects_inside_an_eds_are_shown_with_its_own_lines(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.entry("6065", DefaultValue="twenty"))
    (problem,) = cells.serious(path)
    line = cells.line_of(tmp_path / "drive.eds", "DefaultValue=twenty")
    assert problem.line == cells.line_of(path, "[nodes.1]") + 1
    assert "node 1: its eds has 1 defect" in problem.message
    assert f"{tmp_path / 'drive.eds'}:{line}: " in problem.observed


def test_a_dcf_is_made_for_its_node(tmp_path: Path) -> None:
    commissioning = "[DeviceComissioning]\nNodeID=2\nNodeName=y\nBaudrate=1000\n"
    path = cells.write(tmp_path, ('[nodes.1]\neds = "drive.eds"', '[nodes.1]\ndcf = "x.dcf"'))
    (tmp_path / "x.dcf").write_text(cells.DRIVE + commissioning)
    problem = next(each for each in cells.serious(path) if each.severity.value == "error")
    assert problem.line == cells.line_of(path, "x.dcf")
    assert f"node 1: {tmp_path / 'x.dcf'} is made for node 2" in problem.message


def test_a_dcf_of_the_right_node_serves(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('[nodes.1]\neds = "drive.eds"', '[nodes.1]\ndcf = "x.dcf"'))
    commissioning = "[DeviceComissioning]\nNodeID=1\nNodeName=x\nBaudrate=1000\n"
    (tmp_path / "x.dcf").write_text(cells.DRIVE + commissioning)
    assert cells.serious(path) == []


@pytest.mark.parametrize(
    ("device_type", "profile", "severity"), [("0x00030191", "401", "error"), ("0", "0", "warning")]
)
def test_a_node_with_axes_is_a_cia_402_device(
    tmp_path: Path, device_type: str, profile: str, severity: str
) -> None:
    path = cells.write(tmp_path, eds=cells.entry("1000", DefaultValue=device_type))
    found = cells.serious(path)
    assert [problem.severity.value for problem in found] == [severity, severity]
    assert [problem.line for problem in found] == [
        cells.line_of(path, "[nodes.1]") + 1,
        cells.line_of(path, "[nodes.2]") + 1,
    ]
    assert "node 1 has axes, but by its eds it is not a CiA 402 drive" in found[0].message
    assert f"profile {profile}, not 402" in found[0].observed


def test_a_device_without_a_device_type_is_noted(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.entry("1000", DefaultValue=""))
    assert cells.serious(path) == []
    assert len([each for each in cells.notes(path) if "the type of device" in each.message]) == 2


def test_a_second_axis_has_its_objects_800h_further(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path,
        ("[axes.y]\nnode = 2", "[axes.y]\nnode = 2\ndrive_axis = 2"),
    )
    problem = cells.only(path, "error", "drive_axis = 2")
    assert "axis y: node 2 has no axis 2" in problem.message
    assert "6840h" in problem.observed
    assert "6841h" in problem.observed


def test_a_device_with_two_axes_in_one_object_cannot_be_used(tmp_path: Path) -> None:
    def split(text: str) -> str:
        text = cells.entry(
            "6064", ObjectType="0x8", SubNumber="3", DataType="", AccessType="", PDOMapping=""
        )(text)
        for subindex, kind in ((0, "0x5"), (1, "0x4"), (2, "0x4")):
            text += f"[6064sub{subindex}]\nParameterName=Part {subindex}\nDataType={kind}\nAccessType=ro\nPDOMapping=1\n"
        return text

    found = [
        each for each in cells.serious(cells.write(tmp_path, eds=split)) if each.severity.value == "error"
    ]
    assert [each.message.split(":")[0] for each in found] == ["axis x", "axis y"]
    assert "several axes in the sub-indices" in found[0].message
    assert "6064h (position actual value)" in found[0].observed


@pytest.mark.parametrize(
    ("written", "words", "observed"),
    [
        ("400_000", "400000 bit/s is not a bitrate of CANopen", "250, 500"),
        ("800_000", "node 1 does not run at 800 kbit/s", "has 250, 500, 1000 kbit/s"),
    ],
)
def test_the_bitrate_is_one_that_the_nodes_have(
    tmp_path: Path, written: str, words: str, observed: str
) -> None:
    path = cells.write(tmp_path, ("1_000_000", written), ('"4ms"', '"10ms"'))
    found = cells.serious(path)
    assert {each.severity.value for each in found} == {"warning"}
    assert {each.line for each in found} == {cells.line_of(path, "bitrate")}
    assert words in found[0].message
    assert observed in found[0].observed


def test_an_interface_is_one_that_the_can_library_knows(tmp_path: Path) -> None:
    problem = cells.only(cells.write(tmp_path, ('"pcan"', '"socketcn"')), "error", '"socketcn"')
    assert "'socketcn' is not known" in problem.message
    assert "'socketcan'" in problem.remedy


def test_socketcan_needs_a_channel(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('"pcan"\nchannel = "PCAN_USBBUS1"', '"socketcan"'))
    assert 'channel = "can0"' in cells.only(path, "error", '"socketcan"').remedy
