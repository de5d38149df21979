"""The makes that come with axisbus as drive files: each names its sources, and agrees with the EDS files of its drives."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from axisbus.drives import FaultTexts, registry
from axisbus.drives.plugin import GENERIC, DrivePlugin
from axisbus.eds import load
from axisbus.eds.model import Eds
from axisbus.errors import EdsError
from axisbus.machine.machine import Machine
from kit import command_line
from kit.cell import cell_file, with_identity
from kit.corpus import corpus_files

(VENDORS,) = [source for source in registry.installed() if source.name == "vendors"]
# The makes, and the beginning of the names of their files in the corpus.
FILES = {
    "Elmo Gold": "elmo-motion-control__gold",
    "Faulhaber MC 300x CO": "faulhaber__mc",
    "maxon EPOS": "maxon-motor-ag__mcd-epos-60w",
    "maxon EPOS4": "maxon-motor-ag__epos4",
    "Nanotec": "nanotec",
    "Trinamic TMCM": "trinamic",
}
WITHOUT_FILES = ("Kollmorgen AKD", "Technosoft iPOS")  # no EDS of theirs is in the corpus


def in_corpus(makes: Sequence[DrivePlugin]) -> list[DrivePlugin]:
    return [make for make in makes if make.name not in WITHOUT_FILES]


def of_corpus(name: str) -> list[tuple[Path, Eds]]:
    found = []
    for path in corpus_files():
        if path.name.startswith(FILES[name]):
            try:
                found.append((path, load(path)))
            except EdsError:  # a file that cannot be used describes no drive
                continue
    return found


each_make = pytest.mark.parametrize("make", VENDORS.plugins, ids=lambda make: make.name)


def test_every_make_is_tested() -> None:
    assert sorted(make.name for make in VENDORS.plugins) == sorted([*FILES, *WITHOUT_FILES])


@each_make
def test_a_make_names_its_sources(make: DrivePlugin) -> None:
    assert len(make.sources) >= 2
    assert any("EDS" in source for source in make.sources)


@each_make
def test_a_make_is_for_known_products_only(make: DrivePlugin) -> None:
    assert make.product_codes
    assert registry.find(make.vendor_id, 0xFFFF_FFFE) is GENERIC
    for product in make.product_codes:
        assert registry.find(make.vendor_id, product) == make


@each_make
def test_a_make_has_error_texts_for_its_codes(make: DrivePlugin) -> None:
    texts = make.explain
    assert isinstance(texts, FaultTexts)
    assert texts.codes or make.name == "Trinamic TMCM"  # its codes are not known
    for code, text in texts.codes.items():
        assert make.explain(code, {}) == [text]


@pytest.mark.skipif(not corpus_files(), reason="AXISBUS_EDS_CORPUS names no folder of EDS files")
@pytest.mark.parametrize("make", in_corpus(VENDORS.plugins), ids=lambda make: make.name)
def test_the_files_of_a_make_have_its_identity_and_its_objects(make: DrivePlugin) -> None:
    files = [(path, eds) for path, eds in of_corpus(make.name) if eds.identity.product_code is not None]
    assert files
    for path, eds in files:
        assert registry.make_of(eds) == make, path.name
    codes = {eds.identity.product_code for _, eds in files}
    assert codes <= make.product_codes
    addresses = [(each.index, each.subindex) for each in make.measured.values()]
    addresses += [*make.fault_objects, *((index, sub or 0) for index, sub in make.calibration_objects)]
    if make.node_id is not None:
        addresses += [make.node_id.address, make.node_id.store]
    for index, subindex in addresses:
        having = [path.name for path, eds in files if eds.get(index, subindex) is not None]
        assert len(having) > len(files) / 2, f"{index:04X}h:{subindex:02X}"


@pytest.mark.skipif(not corpus_files(), reason="AXISBUS_EDS_CORPUS names no folder of EDS files")
def test_every_product_code_but_those_of_other_files_is_in_the_corpus() -> None:
    known = {eds.identity.product_code for path in corpus_files() if (eds := _usable(path)) is not None}
    missing = {
        make.name: sorted(make.product_codes - known)
        for make in in_corpus(VENDORS.plugins)
        if make.product_codes - known
    }
    assert missing == {}


def _usable(path: Path) -> Eds | None:
    try:
        return load(path)
    except EdsError:
        return None


def test_explain_has_the_texts_of_the_makes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = command_line.runner(monkeypatch, capsys)("explain", "8A88h").out
    assert "maxon EPOS4: safe torque off is active" in out


# -- where a make is used ------------------------------------------------------------------------------------------------

NANOTEC = 0x26C, 0x10


@pytest.fixture
def cell_of_nanotec(tmp_path: Path) -> Path:
    """A cell of one generic drive with the identity of a Nanotec C5-E."""
    (tmp_path / "drive.eds").write_text(with_identity(*NANOTEC), encoding="utf-8")
    return cell_file(tmp_path, eds="drive.eds")


def test_scan_names_the_make(cell_of_nanotec: Path, axisbus: command_line.Run) -> None:
    scan = axisbus("scan", "-i", "sim", "-c", cell_of_nanotec)
    assert "make Nanotec, vendor 0x26C, product 0x10" in scan.out
    (node,) = json.loads(axisbus("scan", "-i", "sim", "-c", cell_of_nanotec, "--json").out)
    assert node["make"] == "Nanotec"


def test_init_writes_the_notes_of_the_make(
    cell_of_nanotec: Path, axisbus: command_line.Run, tmp_path: Path
) -> None:
    made = tmp_path / "made.toml"
    axisbus("init", "-i", "sim", "-c", cell_of_nanotec, "-o", made, "--eds", tmp_path / "drive.eds")
    assert "# after an update of its firmware it may need a mode in 6060h" in made.read_text(encoding="utf-8")


def test_a_fault_is_explained_by_the_table_of_the_make(cell_of_nanotec: Path) -> None:
    with Machine.simulated(cell_of_nanotec) as machine:
        machine["x"].enable().wait(5)
        machine.simulated_node(1).fault(0x3100)
        machine.sleep(1.0)
        assert "supply voltage too high or too low" in str(machine["x"].error)
        assert machine.node(1).parts.make.name == "Nanotec"
