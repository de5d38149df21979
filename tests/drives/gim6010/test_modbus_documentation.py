"""The tables about Modbus in docs/gim6010-8.md are those that the code reads and writes by."""

from __future__ import annotations

import pytest

from axisbus.boot.stop_report import Watchdog
from axisbus.drives.gim6010.boot.module import watchdog_of
from axisbus.drives.gim6010.settings.watchdog import Armed
from kit.modbus import documentation
from kit.pages import ROOT, rows, text_of

PAGE = ROOT / "docs" / "gim6010-8.md"


@pytest.mark.parametrize(
    ("header", "made", "least"),
    [("addresses", documentation.registers, 36), ("left open", documentation.open_points, 10)],
)
def test_the_page_has_the_tables_of_the_code(header, made, least):
    expected = [list(row) for row in made()]
    assert len(expected) >= least
    assert [list(row) for row in rows(PAGE, header)] == expected


def test_no_cell_breaks_its_row():
    for made in (documentation.registers, documentation.open_points):
        assert [cell for row in made() for cell in row if "|" in cell or "\n" in cell or not cell] == []


def test_that_nothing_notices_a_dead_master_is_on_the_page_and_reported_by_boot():
    page = " ".join(text_of(PAGE).split())
    assert "**No known function of a module detects the loss of the master over Modbus.**" in page
    assert "a velocity or a torque continues and a position is held" in page
    boot = watchdog_of(Armed(), None, relayed=True)
    assert boot.kind is Watchdog.NONE
    assert "Positions hold, a velocity or a torque continues" in boot.text
