"""The behaviour of a make: a drive file that a cell names changes how the master commands a drive; a cell file overrides it."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path

import pytest

from axisbus.cell import reader
from axisbus.cell.axis_description import Drive, with_makes
from axisbus.cell.model import CellConfig
from axisbus.cell.parameters import axis_parameters, modes
from axisbus.check.run import check
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.options import Ramp
from axisbus.core.files import load_dictionaries
from axisbus.drives import Behaviour, drive_file
from axisbus.drives.plugin import AXIS_KEYS
from axisbus.errors import ConfigError, HomingError, SetPointError
from axisbus.machine.machine import Machine
from axisbus.motion.parameters import AxisParameters, DemandUse, Handshake
from kit import command_line, pages
from kit.cell import cell_text, with_identity

VENDOR, PRODUCT = 0x123, 7
BIT_12_NEVER_COMES = """\
name = "ACME"
vendor_id = 0x123
[behaviour]
handshake = "on-change"
"""
M = ModeOfOperation


def write(folder: Path, behaviour: str | None, axis: str = "", named: str = "acme.toml") -> Path:
    """Write a cell of one ACME drive; ``behaviour``: the lines of [behaviour] in its drive file (None: no file)."""
    (folder / "acme.eds").write_text(with_identity(VENDOR, PRODUCT), encoding="utf-8")
    text = cell_text(eds="acme.eds", axis=axis)
    text = text.replace(
        "method = 35\n", "method = 35\nspeed_switch = 300.0\nspeed_zero = 300.0\nacceleration = 500.0\n"
    )
    if behaviour is not None:
        head = 'name = "ACME"\nvendor_id = 0x123\n'
        (folder / "acme.toml").write_text(f"{head}[behaviour]\n{behaviour}\n", encoding="utf-8")
        text = f'drives = ["{named}"]\n{text}'
    path = folder / "cell.toml"
    path.write_text(text, encoding="utf-8")
    return path


def parameters(path: Path) -> AxisParameters:
    cell = reader.load(path)
    return axis_parameters(cell, "x", load_dictionaries(cell)[1])


@contextmanager
def opened(path: Path) -> Iterator[Machine]:
    """The simulated machine, enabled; bit 12 of its drive never comes."""
    with Machine.simulated(path) as machine:
        machine.simulated_node(1).drive().dials.acknowledge_never = True
        machine["x"].enable().wait(5)
        yield machine


# -- a quirk of four lines ---------------------------------------------------------------------------------------------


def test_without_the_drive_file_the_error_names_the_key_to_set(tmp_path: Path) -> None:
    with opened(write(tmp_path, None)) as machine, pytest.raises(SetPointError) as caught:
        machine["x"].move_absolute(10.0).wait(10)
    assert 'handshake = "on-change" in [axes.x]' in caught.value.remedy


def test_with_four_lines_of_a_drive_file_the_drive_moves(tmp_path: Path) -> None:
    path = write(tmp_path, "")
    (tmp_path / "acme.toml").write_text(BIT_12_NEVER_COMES, encoding="utf-8")
    with opened(path) as machine:
        machine["x"].move_absolute(10.0).wait(10)
        assert machine["x"].position == pytest.approx(10.0, abs=0.1)
        (axis,) = machine.reports[0].axes
        assert axis.by_make == 'handshake = "on-change" (ACME)'
    assert len(BIT_12_NEVER_COMES.splitlines()) == 4
    assert pages.drive_files().count(BIT_12_NEVER_COMES) == 2  # in docs/drives.md and CONTRIBUTING.md


def test_the_cell_file_overrides_the_drive_file(tmp_path: Path) -> None:
    path = write(tmp_path, 'handshake = "on-change"', axis='handshake = "acknowledge"')
    with opened(path) as machine, pytest.raises(SetPointError):
        machine["x"].move_absolute(10.0).wait(10)


@pytest.mark.parametrize("method", [35, 34])
def test_a_drive_that_never_sets_bit_10_in_homing(tmp_path: Path, method: int) -> None:
    ended = {}
    for behaviour in (None, "homing_reached = false"):
        with opened(write(tmp_path, behaviour)) as machine:
            drive = machine.simulated_node(1).drive()
            drive.dials.homing_reached_never = True
            handle = machine["x"].home(method=method, timeout=10.0)
            machine.sleep(14.0)
            ended[behaviour] = handle.exception()
            if ended[behaviour] is None:
                assert machine["x"].homed
                assert drive.velocity == 0
    without = ended[None]
    assert isinstance(without, HomingError)
    assert "homing_reached = false in [axes.x]" in without.remedy
    assert ended["homing_reached = false"] is None


# -- each key of [behaviour] has its effect, and a cell file overrides it -----------------------------------------------

KEYS = {
    "handshake": ('"on-change"', '"acknowledge"', lambda p: p.handshake, Handshake.ON_CHANGE, Handshake.ACKNOWLEDGE),
    "homing_reached": ("false", "true", lambda p: p.homing_reached, False, True),
    "demand": ('"ignore"', '"auto"', lambda p: p.demand, DemandUse.IGNORE, DemandUse.AUTO),
    "modes": ('["pp"]', '["pv"]', lambda p: p.modes, {M.PROFILE_POSITION}, {M.PROFILE_VELOCITY}),
    "transition_time": ('"5s"', '"2s"', lambda p: p.timing.transition, 5.0, 2.0),
    "mode_time": ('"4s"', '"1s"', lambda p: p.timing.mode, 4.0, 1.0),
    "acknowledge_time": ('"3s"', '"1s"', lambda p: p.timing.acknowledge, 3.0, 1.0),
    "ignored_objects": ('["605Dh"]', "[]", lambda p: (p.has(0x605D), p.braking.halt), (False, Ramp.UNKNOWN), (True, Ramp.SLOW)),
}  # fmt: skip


@pytest.mark.parametrize("key", KEYS)
def test_a_make_sets_a_key_of_its_axes_and_a_cell_file_overrides_it(tmp_path: Path, key: str) -> None:
    by_make, by_cell, value, made, overridden = KEYS[key]
    assert value(parameters(write(tmp_path, f"{key} = {by_make}"))) == made
    assert value(parameters(write(tmp_path, f"{key} = {by_make}", axis=f"{key} = {by_cell}"))) == overridden
    assert value(parameters(write(tmp_path, None))) != made


def test_every_key_of_behaviour_is_tested_here() -> None:
    assert set(KEYS) == set(AXIS_KEYS) == set(drive_file.OF_AXIS)
    assert set(drive_file.BEHAVIOUR) == {field.name for field in fields(Behaviour)}
    assert set(drive_file.BEHAVIOUR) - set(KEYS) == {"lists_modes", "store_restarts"}  # in the tests below


def test_modes_of_6502h_are_completed_by_the_objects_if_the_make_does_not_list_them(tmp_path: Path) -> None:
    found = {}
    for lists in ("true", "false"):
        cell = reader.load(write(tmp_path, f"lists_modes = {lists}"))
        drive = Drive.of(cell.axes["x"], cell.nodes[1], load_dictionaries(cell)[1])
        found[lists] = modes(drive, {M.PROFILE_POSITION})
    assert found["true"] == {M.PROFILE_POSITION}
    assert found["false"] > found["true"]


def test_a_drive_whose_make_restarts_on_storing_restarts_in_the_simulation(tmp_path: Path) -> None:
    for restarts in (True, False):
        path = write(tmp_path, f"store_restarts = {str(restarts).lower()}")
        with Machine.simulated(path) as machine:
            assert machine.simulated_node(1).device.dials.reboot_on_store is restarts


def test_the_checks_see_what_the_make_sets(tmp_path: Path) -> None:
    path = write(tmp_path, 'demand = "ignore"')
    assert [each for each in check(path) if "6062h is not used" in each.message]
    assert not [each for each in check(write(tmp_path, None)) if "6062h is not used" in each.message]


def test_a_check_names_the_make_in_its_remedy(tmp_path: Path) -> None:
    path = write(tmp_path, 'handshake = "on-change"')
    eds = tmp_path / "acme.eds"
    text = eds.read_text(encoding="utf-8")
    for line in text.splitlines():  # without 6062h
        if line.lower().endswith("=0x6062"):
            text = text.replace(line + "\n", "")
    begin = text.index("[6062]")
    eds.write_text(text[:begin] + text[text.index("[", begin + 1) :], encoding="utf-8")
    (found,) = [each for each in check(path) if "judges a move" in each.message]
    assert 'write handshake = "acknowledge" in [axes.x]' in found.remedy


def test_left_out_and_chosen_can_be_told_apart(tmp_path: Path) -> None:
    assert reader.load(write(tmp_path, None)).axes["x"].handshake is None
    chosen = reader.load(write(tmp_path, None, axis='handshake = "acknowledge"')).axes["x"]
    assert chosen.handshake == "acknowledge"


def test_axes_of_other_nodes_stay_as_they_are(tmp_path: Path) -> None:
    path = write(tmp_path, 'handshake = "on-change"')
    _, heading, second = cell_text("xy").partition("[nodes.2]")
    path.write_text(path.read_text(encoding="utf-8") + heading + second, encoding="utf-8")
    cell: CellConfig = reader.load(path)
    seen = with_makes(cell, load_dictionaries(cell))
    assert (seen.axes["x"].handshake, seen.axes["y"].handshake) == ("on-change", None)


# -- the files that a cell names ----------------------------------------------------------------------------------------


def test_a_cell_may_name_a_folder(tmp_path: Path) -> None:
    path = write(tmp_path, 'handshake = "on-change"', named="makes")
    (tmp_path / "makes").mkdir()
    (tmp_path / "acme.toml").rename(tmp_path / "makes" / "acme.toml")
    assert parameters(path).handshake is Handshake.ON_CHANGE


def test_the_closest_identity_is_used(tmp_path: Path) -> None:
    path = write(tmp_path, 'handshake = "on-change"', named=".")
    path.rename(tmp_path / "cell.txt")  # the folder of the drive files has no other .toml file
    for name, product, mode_time in (("a", 6, "5s"), ("b", PRODUCT, "6s")):
        (tmp_path / f"{name}.toml").write_text(
            f'name = "{name}"\nvendor_id = 0x123\nproduct_codes = [{product}]\n[behaviour]\nmode_time = "{mode_time}"\n',
            encoding="utf-8",
        )
    found = parameters(tmp_path / "cell.txt")
    assert (found.timing.mode, found.handshake) == (6.0, Handshake.ACKNOWLEDGE)


def test_a_report_of_a_fault_contains_the_drive_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, archive = write(tmp_path, 'handshake = "on-change"'), tmp_path / "report.zip"
    result = command_line.runner(monkeypatch, capsys)("report", path, "-o", archive, "--yes")
    assert result.code == 0, result.err
    assert "drives/acme.toml" in zipfile.ZipFile(archive).namelist()


@pytest.mark.parametrize(
    ("named", "text", "message"),
    [
        ("other.toml", "", r"other\.toml: the file does not exist"),
        ("acme.toml", "handshak = 1", r"acme\.toml:4: unknown key 'handshak' in \[behaviour\]"),
        ("empty", "", r"cell\.toml:1: the folder 'empty' has no drive file"),
        ('acme.toml", "./acme.toml', "", r"cell\.toml:1: .* describe the same drives"),
        ("", "", r"cell\.toml:1: drives in a cell file cannot be used"),
    ],
)
def test_a_drive_file_that_cannot_be_used_is_an_error_of_the_cell(
    tmp_path: Path, named: str, text: str, message: str
) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(ConfigError, match=message):
        reader.load(write(tmp_path, text, named=named))


def test_the_faults_of_a_make_are_explained_at_its_axis(tmp_path: Path) -> None:
    path = write(tmp_path, "")
    with (tmp_path / "acme.toml").open("a", encoding="utf-8") as file:
        file.write('[errors]\nFF01h = "fan blocked"\n')
    with Machine.simulated(path) as machine:
        machine["x"].enable().wait(5)
        machine.simulated_node(1).fault(0xFF01)
        machine.sleep(1.0)
        assert "fan blocked" in str(machine["x"].error)
        node = machine.node(1)
        assert "fan blocked" in " ".join(node.format_incident(node.incidents[-1]))
