"""The makes that come with axisbus as drive files: each names its sources, and agrees with the EDS files of its drives."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.drives import FaultTexts, registry
from axisbus.drives.plugin import GENERIC, DrivePlugin
from axisbus.eds import load
from axisbus.eds.model import Eds
from axisbus.errors import EdsError
from kit import command_line
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
    assert [make.name for make in VENDORS.plugins] == list(FILES)


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
@each_make
def test_the_files_of_a_make_have_its_identity_and_its_objects(make: DrivePlugin) -> None:
    files = [(path, eds) for path, eds in of_corpus(make.name) if eds.identity.product_code is not None]
    assert files
    for path, eds in files:
        assert registry.make_of(eds) == make, path.name
    codes = {eds.identity.product_code for _, eds in files}
    assert codes <= make.product_codes
    addresses = [(each.index, each.subindex) for each in make.measured.values()]
    addresses += [*make.fault_objects, *((index, sub or 0) for index, sub in make.calibration_objects)]
    for index, subindex in addresses:
        having = [path.name for path, eds in files if eds.get(index, subindex) is not None]
        assert len(having) > len(files) / 2, f"{index:04X}h:{subindex:02X}"


@pytest.mark.skipif(not corpus_files(), reason="AXISBUS_EDS_CORPUS names no folder of EDS files")
def test_every_product_code_but_those_of_other_files_is_in_the_corpus() -> None:
    known = {eds.identity.product_code for path in corpus_files() if (eds := _usable(path)) is not None}
    missing = {
        make.name: sorted(make.product_codes - known)
        for make in VENDORS.plugins
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
