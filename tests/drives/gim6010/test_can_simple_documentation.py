"""The tables of docs/gim6010-8.md are those that the code reads and writes by."""

from __future__ import annotations

import pytest

from kit.can_simple import documentation
from kit.pages import ROOT, rows

PAGE = ROOT / "docs" / "gim6010-8.md"


@pytest.mark.parametrize(
    ("header", "made", "least"),
    [
        ("ID", documentation.messages, 30),
        ("category", documentation.error_bits, 60),
        ("subject", documentation.contradictions, 20),
    ],
)
def test_the_page_has_the_tables_of_the_code(header, made, least):
    expected = [list(row) for row in made()]
    assert len(expected) >= least
    assert [list(row) for row in rows(PAGE, header)] == expected


def test_no_cell_breaks_its_row():
    for made in (documentation.messages, documentation.error_bits, documentation.contradictions):
        assert [cell for row in made() for cell in row if "|" in cell or "\n" in cell or not cell] == []
