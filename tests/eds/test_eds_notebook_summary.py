"""The display of an EDS in a notebook."""

from __future__ import annotations

import pytest

from axisbus import eds
from kit.pages import ROOT

FILES = sorted((ROOT / "eds").glob("*.eds"))
PDOS = {
    "generic-cia401": "2 RPDOs, 2 TPDOs",
    "generic-cia402": "4 RPDOs, 4 TPDOs",
    "gim6010-8": "4 RPDOs, 4 TPDOs",
}
EVIL = "<b>Drive & Co</b>"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_html_of_a_file_names_the_device_and_its_pdos(path):
    read = eds.load(path)
    shown = read._repr_html_()
    assert read.info["deviceinfo"]["productname"] in shown
    assert "cannot be shown" not in shown
    assert PDOS[path.stem] in shown


def test_texts_of_a_file_are_escaped_in_html():
    data = FILES[0].read_text(encoding="ascii").replace("\nProductName=", f"\nProductName={EVIL}")
    shown = eds.loads(data.encode("ascii"), "<i>file</i>")._repr_html_()
    assert EVIL not in shown
    assert "&lt;b&gt;Drive &amp; Co" in shown
    assert "<i>" not in shown


def test_the_html_of_a_file_with_little_content_names_the_unknowns():
    data = b"[MandatoryObjects]\nSupportedObjects=1\n1=0x1001\n[1001]\nParameterName=Error register\nDataType=5\nAccessType=ro\n"
    shown = eds.loads(data, "x.eds")._repr_html_()
    assert "not named" in shown
    assert "unknown, unknown" in shown
