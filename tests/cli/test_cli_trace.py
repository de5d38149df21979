"""``axisbus trace`` and ``axisbus load`` as their user types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from kit import command_line

LOG = """\
(100.000000) can0 701#00
(100.010000) can0 601#4041600000000000
(100.011000) can0 581#4B41600050020000
(100.020000) can0 601#4007600000000000
(100.021500) can0 581#8007600000000206
(100.030000) can0 181#37160100800000
(100.040000) can0 081#1186210102000000
(100.200000) can0 080#
"""


@pytest.fixture
def log(tmp_path) -> Path:
    path = tmp_path / "run.log"
    path.write_text(LOG)
    return path


def test_a_recording_in_words_with_the_cells_names_and_units(axisbus, log):
    code, out, err = axisbus("trace", log, "--cell", command_line.CELL)
    assert code == 0
    lines = out.splitlines()
    assert len(lines) == 8
    assert "1 x        boot-up" in lines[0]
    assert lines[2].split(maxsplit=3)[:3] == ["0.011000", "+0.001000", "581h"]
    assert "read 6041h Statusword = 0x0250 (switch on disabled; voltage enabled, remote)  [1 ms]" in lines[2]
    assert "0x06020000, Object does not exist" in lines[4]
    assert "Position actual value 32768 = 90 deg" in lines[5]
    assert "0x8611, Following error" in lines[6]
    assert "8 frames, 8 shown, 2 of them with errors" in err


def test_standard_input_without_any_file(axisbus):
    code, out, err = axisbus("trace", "-", stdin="noise\n" + LOG)
    assert code == 0
    assert "TPDO1, mapping not known: 37 16 01 00 80 00 00" in out
    assert "1 line is not a frame, the first is 1: noise" in err


def test_an_eds_for_one_node(axisbus, log):
    code, out, _ = axisbus("trace", log, "--eds", "1=builtin:gim6010-8", "--filter", "kind=sdo")
    assert code == 0
    assert "read 6041h Statusword" in out


def test_trace_prints_one_json_object_per_line(axisbus, log):
    code, out, _ = axisbus("trace", log, "--json", "--cell", command_line.CELL)
    frames = [json.loads(each) for each in out.splitlines()]
    assert code == 0
    assert [frame["kind"] for frame in frames] == ["boot-up", *["SDO"] * 4, "TPDO", "EMCY", "SYNC"]
    assert frames[2]["objects"][0] == {
        "index": 0x6041,
        "subindex": 0,
        "name": "Statusword",
        "value": 0x0250,
        "words": "switch on disabled; voltage enabled, remote",
    }
    assert frames[4]["sdo"] == {"step": "aborted", "write": False, "abort": 0x06020000, "waited": 0.0015}
    assert (frames[5]["objects"][2]["quantity"], frames[5]["objects"][2]["unit"]) == (90.0, "deg")
    assert frames[0]["time"] == 100.0


def test_errors_only_prints_faults_and_sets_the_exit_code(axisbus, log):
    code, out, _ = axisbus("trace", log, "--errors-only")
    assert code == 1
    assert len(out.splitlines()) == 2
    code, out, _ = axisbus("trace", log, "--errors-only", "--without", "kind=sdo,emcy")
    assert (code, out) == (0, "")


def test_filters_narrow(axisbus, log):
    assert len(axisbus("trace", log, "--filter", "object=6041").out.splitlines()) == 2
    assert len(axisbus("trace", log, "--filter", "node=1", "--filter", "kind=pdo,emcy").out.splitlines()) == 2
    assert len(axisbus("trace", log, "--without", "kind=sdo", "--count", "2").out.splitlines()) == 2


def test_own_times(axisbus, log):
    assert "100.200000" in axisbus("trace", log, "--absolute").out


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ((), 2, "give a cell file, a recording"),
        (("x.log", "-i", "virtual", "-c", "a"), 2, "both name the source of the frames"),
        (("x.log",), 1, "there is no recording x.log"),
        (("-", "--filter", "knid=sdo"), 2, "is not a filter"),
        (("-", "--filter", "kind=sod"), 2, "did you mean sdo?"),
        (("-", "--eds", "drive.eds"), 2, "write --eds 5=drive.eds"),
        (("-", "--eds", "5=no.eds"), 1, "no.eds"),
        (("none.toml",), 1, "none.toml"),
        (("-i", "nothing"), 3, "'nothing' is not known to python-can"),
    ],
)
def test_misuse_is_one_clear_sentence(axisbus, arguments, code, words):
    result = axisbus("trace", *arguments)
    assert result.code == code
    assert words in result.err


def test_a_live_bus_is_only_listened_to(axisbus):
    code, out, _ = axisbus("trace", command_line.CELL, "--seconds", "20", "--count", "3")
    assert code == 0
    assert [line.split()[-2:] for line in out.splitlines()] == [["enters", "pre-operational"]] * 3


# -- load --------------------------------------------------------------------------------------------------------------


def test_the_planned_load_of_a_cell(axisbus):
    code, out, _ = axisbus("load", command_line.CELL)
    assert code == 0
    assert "planned at 1000 kbit/s, a cycle each 4 ms" in out
    assert "37.0% without stuff bits, 44.8% with the most there can be" in out
    assert "node 127" in out
    assert "next: measure it" in out


def test_the_measured_load_of_a_recording(axisbus, log):
    code, out, _ = axisbus("load", log, "-b", "10000", "--json")
    found = json.loads(out)["measured"]
    assert code == 0
    assert (found["frames"], found["seconds"]) == (8, pytest.approx(0.2))
    assert found["load"] <= found["load_worst"] < 0.6
    assert found["worst_100ms"]["at"] == pytest.approx(0.04)
    assert [(row["node"], row["frames"]) for row in found["by_node"]] == [(None, 1), (1, 7)]
    assert {row["kind"] for row in found["by_kind"]} == {"boot-up", "SDO", "TPDO", "EMCY", "SYNC"}


def test_error_frames_are_counted_by_kind_and_the_checks_are_printed(axisbus, tmp_path):
    path = tmp_path / "bad.log"
    errors = "".join(f"(100.0{n}0000) can0 20000204#0020000000008{n}00\n" for n in range(1, 4))
    path.write_text(LOG + errors + "(100.300000) can0 20000040#0000000000000000\n")
    _, out, _ = axisbus("load", path, "-b", "10000")
    lines = [line.strip() for line in out.splitlines()]
    at = lines.index("error frames: 4")
    assert lines[at + 1 : at + 4] == [
        "3 x transmit errors (passive)",
        "1 x bus-off",
        "check bit rate, wiring (CAN-H, CAN-L, ground) and the two 120 Ω terminations",
    ]
    code, out, _ = axisbus("trace", path, "--errors-only")
    assert code == 1
    assert "transmit errors (passive) (transmit errors 129, receive errors 0)" in out


def test_a_full_bus_sets_the_exit_code(axisbus, log):
    log.write_text("".join(line * 2 for line in log.read_text().splitlines(keepends=True)))
    assert axisbus("load", log, "-b", "5000").code == 1
    assert axisbus("load", log, "-b", "500000").code == 0


def test_plan_and_measurement_side_by_side(axisbus):
    code, out, _ = axisbus("load", command_line.CELL, "--seconds", "0.3")
    assert code == 0
    assert "planned at" in out
    assert "measured at 1000 kbit/s" in out


def test_without_a_bit_rate_there_is_no_load(axisbus, log):
    code, _, err = axisbus("load", log)
    assert code == 2
    assert "the bit rate is not known" in err


def test_a_recording_without_times_has_no_load(axisbus):
    code, _, err = axisbus("load", "-", "-b", "500000", stdin="  can0  705   [1]  05\n")
    assert code == 1
    assert "too short" in err


def test_protocol_errors_are_summed_up_at_the_end(axisbus, tmp_path):
    path = tmp_path / "odd.log"
    path.write_text("(1.0) can0 182#37\n(1.1) can0 182#37\n(1.2) can0 182#\n(1.3) can0 085#204308\n")
    code, _, err = axisbus("trace", path, "--cell", command_line.CELL, "--filter", "kind=sync")
    assert code == 0
    assert "against the protocol: 1 EMCY (node 5), 3 TPDO (node 2)" in err


def test_the_load_of_a_recording_names_lines_that_are_no_frames(axisbus, tmp_path):
    path = tmp_path / "odd.log"
    path.write_text("(1.0) can0 182#37\nnoise\n(1.1) can0 182#37\n")
    code, out, _ = axisbus("load", path, "-b", "1000000")
    assert code == 0
    assert "1 line is not a frame, the first is 2: noise" in out
    assert json.loads(axisbus("load", path, "-b", "1000000", "--json").out)["measured"]["lines_skipped"] == 1


def candump(*rows):
    return "".join(f"({time:.6f}) can{bus} {identifier}#{data}\n" for time, bus, identifier, data in rows)


BUSES = candump(
    (10.0, 0, "601", "4041600000000000"),
    (10.1, 1, "601", "4064600000000000"),
    (10.2, 0, "581", "4B41600037020000"),
    (10.3, 1, "581", "4364600010270000"),
    (10.4, 0, "701", "05"),
    (10.5, 1, "701", "7F"),
)


def test_each_bus_of_a_recording_is_decoded_separately(axisbus, tmp_path):
    path = tmp_path / "two.log"
    path.write_text(BUSES)
    code, out, err = axisbus("trace", path, "--errors-only")
    assert (code, out) == (0, "")
    assert "has 2 buses: can0 (3 frames), can1 (3 frames); --channel NAME selects one" in err
    _, out, _ = axisbus("trace", path)
    assert [line.split()[0] for line in out.splitlines()[1:]] == ["can1", "can0", "can1", "can0", "can1"]
    found = [json.loads(line) for line in axisbus("trace", path, "--json").out.splitlines()]
    assert [each.get("channel") for each in found[1:]] == ["can1", "can0", "can1", "can0", "can1"]


def test_one_bus_of_a_recording_is_chosen(axisbus, tmp_path):
    path = tmp_path / "two.log"
    path.write_text(BUSES)
    _, out, err = axisbus("trace", path, "--channel", "can1")
    assert "6041h" not in out
    assert "6064h" in out
    assert "3 frames" in err
    code, _, err = axisbus("trace", path, "--channel", "can2")
    assert code == 1
    assert "there are can0, can1" in err
    assert "6064h" in axisbus("trace", "-", "--channel", "can1", stdin=BUSES).out


def test_the_load_is_that_of_one_bus(axisbus, tmp_path):
    path = tmp_path / "two.log"
    path.write_text(BUSES)
    code, _, err = axisbus("load", path, "-b", "500000")
    assert code == 1
    assert "choose one of them: --channel NAME" in err
    code, out, _ = axisbus("load", path, "-b", "500000", "--channel", "can0", "--json")
    assert (code, json.loads(out)["measured"]["frames"]) == (0, 3)


def test_times_that_go_back_are_reported(axisbus):
    times = " (001.000000)  can0  701   [1]  05\n (001.000000)  can0  701   [1]  05\n (000.000500)  can0  701   [1]  05\n"
    for command in (("trace", "-"), ("load", "-", "-b", "500000")):
        assert "the times go back 1 time" in axisbus(*command, stdin=times).err
    assert "go back" not in axisbus("trace", "-", stdin=BUSES).err
