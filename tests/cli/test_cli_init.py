"""``axisbus init``: a first cell file from simulated drives on a bus, which ``axisbus check`` accepts."""

from __future__ import annotations

import itertools
import json
import os
import tomllib

import pytest

from axisbus import eds
from axisbus.bus.node.discover import DiscoveredNode
from axisbus.bus.node.node import NodeIdentity
from axisbus.check.run import check
from axisbus.cia301.nmt import NmtState
from axisbus.drives.plugin import GENERIC as GENERIC_MAKE
from axisbus.eds import builtin
from axisbus.scaffold.draft import BusFound, NodeFound, draft
from axisbus.scaffold.match import CandidateFile, FileMatch, collect, match
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork
from kit import command_line

GENERIC = (command_line.ROOT / "eds" / "generic-cia402.eds").read_text()
CHANNELS = (f"init-{os.getpid()}-{number}" for number in itertools.count())
VENDOR, PRODUCT = 0x1234, 0x42


def _identity(text, sub, value):
    begin = text.index(f"[1018sub{sub}]")
    old = text.index("DefaultValue=", begin)
    return text[:old] + f"DefaultValue={value}" + text[text.index("\n", old) :]


def drive_text(revision=1, product=PRODUCT):
    text = GENERIC
    for sub, value in ((1, VENDOR), (2, product), (3, revision)):
        text = _identity(text, sub, value)
    return text


def two_axes(text):
    """The same drive with a second axis: every object of the profile once more, 800h further."""
    _, *parts = text.split("\n[")
    profile = [part for part in parts if part[:1] == "6" and part[1:4].isalnum()]
    shifted = "".join(f"\n[{int(part[:4], 16) + 0x800:04X}{part[4:]}" for part in profile)
    return text + "\n" + shifted


@pytest.fixture
def axisbus(monkeypatch, capsys, tmp_path) -> command_line.Run:
    monkeypatch.chdir(tmp_path)
    return command_line.runner(monkeypatch, capsys)


@pytest.fixture
def bus():
    """A function that puts drives on a bus, node ID to EDS text, and returns the options that reach it."""
    opened = []

    def put(**nodes):
        name = next(CHANNELS)
        devices = [
            device_from_eds(eds.loads(text.encode(), "live.eds"), int(node[1:]))
            for node, text in nodes.items()
        ]
        simulated_nodes = SimulatedNetwork(name, devices)
        simulated_nodes.start()
        opened.append(simulated_nodes)
        command_line.until(lambda: all(each.answers_sdo for each in devices))
        return ("-i", "virtual", "-c", name), devices

    yield put
    for each in opened:
        each.close()


def _uncommented(text):
    """The file as a user makes it who confirms every proposal that has a value."""
    lines = []
    for line in text.splitlines():
        proposed, sign, _ = line.partition(" # CONFIRM")
        lines.append(line.removeprefix("# ") if sign and "..." not in proposed else line)
    return "\n".join(line for line in lines if not line.startswith('unit = "increments"'))


def test_nodes_files_and_axes_are_in_the_file_and_check_finds_no_error(axisbus, bus, tmp_path):
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "drive.eds").write_text(drive_text())
    options, devices = bus(n7=drive_text(), n11=drive_text())
    before = [dict(each.dictionary.values) for each in devices]
    code, out, err = axisbus("init", *options, "-b", "500000", "--eds", "files", "-o", "cell.toml")
    assert code == 0, err
    cell = tomllib.loads((tmp_path / "cell.toml").read_text())
    assert cell["bus"] == {
        "interface": "virtual",
        "channel": options[3],
        "bitrate": 500_000,
        "scan_period": "10ms",
        "heartbeat": "100ms",
    }
    assert cell["nodes"] == {"7": {"eds": "files/drive.eds"}, "11": {"eds": "files/drive.eds"}}
    assert {name: (axis["node"], axis["unit"]) for name, axis in cell["axes"].items()} == {
        "axis7": (7, "increments"),
        "axis11": (11, "increments"),
    }
    assert "CONFIRM: axis axis7" in out
    assert 'bit 12 is not usable: handshake = "on-change"' in (tmp_path / "cell.toml").read_text()
    assert not [each for each in check(tmp_path / "cell.toml") if each.severity.value == "error"]
    assert [dict(each.dictionary.values) for each in devices] == before  # nothing was written
    assert [each.drive.statusword & 0x6F for each in devices] == [0x40, 0x40]


def test_proposals_are_comments_with_values_of_the_drive_and_can_be_confirmed(axisbus, bus, tmp_path):
    (tmp_path / "drive.eds").write_text(drive_text())
    options, _ = bus(n7=drive_text())
    assert axisbus("init", *options, "-b", "500000", "--eds", ".").code == 0
    text = (tmp_path / "cell.toml").read_text()
    # 608Fh of the generic drive: 10000 increments per turn, so 10000/360 = 250/9 per degree.
    assert '# scale = "250/9"' in text
    assert "607Fh is 500000 in the drive's own unit" in text
    assert '# quick_stop = "ramp"' in text
    confirmed = _uncommented(text)
    (tmp_path / "confirmed.toml").write_text(confirmed)
    axis = tomllib.loads(confirmed)["axes"]["axis7"]
    assert (axis["unit"], axis["scale"], axis["stop"]["quick_stop"]) == ("deg", "250/9", "ramp")
    assert not [each for each in check(tmp_path / "confirmed.toml") if each.severity.value == "error"]


def test_both_axes_of_a_two_axis_drive(axisbus, bus, tmp_path):
    (tmp_path / "drive.eds").write_text(two_axes(drive_text()))
    options, _ = bus(n7=two_axes(drive_text()))
    assert axisbus("init", *options, "-b", "500000", "--eds", ".").code == 0
    axes = tomllib.loads((tmp_path / "cell.toml").read_text())["axes"]
    assert {name: (axis["node"], axis.get("drive_axis", 1)) for name, axis in axes.items()} == {
        "axis7_1": (7, 1),
        "axis7_2": (7, 2),
    }
    assert not [each for each in check(tmp_path / "cell.toml") if each.severity.value == "error"]


def test_missing_data_are_named_and_set_the_exit_code(axisbus, bus, tmp_path):
    options, _ = bus(n7=drive_text(), n127=GENERIC)
    code, out, _ = axisbus("init", *options)
    assert code == 1
    assert "MISSING: node 7: no EDS (no file of vendor 0x1234, product 0x42)" in out
    assert "MISSING: node 127: no EDS (the device reports no vendor ID" in out
    assert "MISSING: the bit rate of the bus is not known" in out
    text = (tmp_path / "cell.toml").read_text()
    assert tomllib.loads(text)["bus"]["master_id"] == 126  # 127 is taken
    wrong = [each.message for each in check(tmp_path / "cell.toml") if each.severity.value == "error"]
    assert sorted(wrong) == ["[nodes.127] gives neither eds nor dcf", "[nodes.7] gives neither eds nor dcf"]


def test_a_built_in_eds_is_found_by_identity(axisbus, bus, tmp_path):
    options, _ = bus(n3=(command_line.ROOT / "eds" / "gim6010-8.eds").read_text())
    code, out, _ = axisbus("init", *options, "-b", "1000000", "--json")
    assert code == 0
    assert json.loads(out)["nodes"][0]["eds"] == ["builtin:gim6010-8"]
    assert tomllib.loads((tmp_path / "cell.toml").read_text())["nodes"] == {"3": {"eds": "builtin:gim6010-8"}}


def test_a_cell_file_that_is_there_is_not_replaced(axisbus, bus, tmp_path):
    (tmp_path / "cell.toml").write_text("mine\n")
    options, _ = bus(n7=drive_text())
    code, _, err = axisbus("init", *options)
    assert (code, (tmp_path / "cell.toml").read_text()) == (1, "mine\n")
    assert "cell.toml already exists; nothing was written" in err
    axisbus("init", *options, "--force")
    assert (tmp_path / "cell.toml").read_text() != "mine\n"


def test_an_empty_bus_makes_no_file(axisbus, tmp_path):
    code, _, err = axisbus("init", "-i", "virtual", "-c", next(CHANNELS))
    assert code == 1
    assert "no node answered on the bus; no cell file was written" in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ((), 2, "give the bus with -i"),
        (("-i", "virtual", "--eds", "nowhere"), 1, "nowhere is neither a folder nor a file"),
    ],
)
def test_bad_input_is_one_clear_sentence(axisbus, arguments, code, words):
    result = axisbus("init", *arguments)
    assert result.code == code
    assert words in result.err


def test_the_cell_file_is_toml_whatever_the_names_of_the_device_and_the_channel():
    node = DiscoveredNode(
        7, True, None, NodeIdentity(0x20192, VENDOR, PRODUCT, 1, None, 'Dr"ive\n[bus]\x00\\ü')
    )
    found = NodeFound(node, FileMatch((), exact=False, note="none"), ('a"b\\c.eds',), (), GENERIC_MAKE)
    made = draft(BusFound('so"cket\n', "\\.\\COM1", 125_000, {"fd": False, "name": "a'b"}), [found])
    cell = tomllib.loads(made.text)
    assert cell["bus"]["interface"] == 'so"cket\n'
    assert cell["bus"]["channel"] == "\\.\\COM1"
    assert cell["bus"]["options"] == {"fd": False, "name": "a'b"}
    assert cell["nodes"]["7"] == {"eds": 'a"b\\c.eds'}


def test_a_stopped_node_is_left_out_and_named():
    found = NodeFound(
        DiscoveredNode(9, False, NmtState.STOPPED), FileMatch((), exact=False), (), (), GENERIC_MAKE
    )
    made = draft(BusFound("socketcan", "can0", 125_000), [found])
    assert made.missing == ("node 9 does not answer SDO (it reports stopped): it is left out",)
    assert tomllib.loads(made.text).keys() == {"bus"}


# -- which file is a device's ------------------------------------------------------------------------------------------


def _known(name, **identity):
    return CandidateFile(name, eds.loads(drive_text(**identity).encode(), name))


def test_the_file_of_the_same_revision_is_taken_before_others():
    files = [_known("old.eds", revision=1), _known("new.eds", revision=2)]
    found = match(files, 7, VENDOR, PRODUCT, 2)
    assert found.chosen is not None
    assert (found.chosen.spec, found.exact) == ("new.eds", True)


def test_a_file_of_another_revision_is_taken_with_a_word_and_of_two_none():
    one = match([_known("old.eds", revision=1)], 7, VENDOR, PRODUCT, 3)
    assert one.chosen is not None
    assert one.note == "the device has revision 0x3"
    files = [
        _known("a.eds", revision=1),
        CandidateFile("b.eds", eds.loads(two_axes(drive_text(2)).encode(), "b.eds")),
    ]
    two = match(files, 7, VENDOR, PRODUCT, 3)
    assert two.chosen is None
    assert [each.spec for each in two.files] == ["a.eds", "b.eds"]


def test_a_file_without_a_vendor_matches_no_device():
    files, _ = collect(())
    assert f"{builtin.PREFIX}generic-cia402" in {each.spec for each in files}
    assert match(files, 7, 0, 0, 0).files == ()
    assert match(files, 7, VENDOR, PRODUCT, 1).files == ()


def test_an_eds_of_another_product_of_the_vendor_is_not_matched():
    assert match([_known("other.eds", product=0x43)], 7, VENDOR, PRODUCT, 1).files == ()
