"""The reference of a device as HTML and Markdown: whole, self-contained, well-formed, to scale, safe against any names."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from axisbus.eds import Eds, EdsFinding, Severity, layout, load
from axisbus.eds import device_doc as reference_package
from axisbus.eds.device_doc import html, markdown, reference
from kit.eds.samples import BITS, CORPUS, EVERY_TENTH, STATUS, builtin, communication, mapped, small
from kit.eds.texts import record, variable

VOID = frozenset(("meta", "rect", "path", "col", "br"))
NASTY = '<script>alert("x")</script> & | `code` *bold*'


class Page(HTMLParser):
    """Reads a page: its text, anchors, links and drawings; complains where tags do not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: list[str] = []
        self.links: list[str] = []
        self.tags: set[str] = set()
        self.attributes: list[tuple[str, str | None]] = []
        self.boxes: list[tuple[float, float]] = []
        self.said = ""
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.tags.add(tag)
        self.attributes += attrs
        if given.get("id"):
            self.anchors.append(given["id"] or "")
        if tag == "a":
            self.links.append(given["href"] or "")
        if tag == "rect" and given["class"] in ("box", "space"):
            self.boxes.append((float(given["x"] or 0), float(given["width"] or 0)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag, self.getpos()

    def handle_data(self, data: str) -> None:
        if self._open[-1:] != ["style"]:
            self.said += data


def page(eds: Eds, node_id: int | None = None) -> Page:
    return Page(html(reference(eds, node_id)))


@pytest.mark.parametrize("path", EVERY_TENTH, ids=lambda path: path.stem[:40])
def test_a_page_is_well_formed_and_every_object_can_be_linked_to(path: Path) -> None:
    eds = load(path)
    seen = page(eds)
    assert len(set(seen.anchors)) == len(seen.anchors)
    assert {f"o{index:04X}" for index in eds.objects} <= set(seen.anchors)
    assert {link.removeprefix("#") for link in seen.links} <= set(seen.anchors)
    for entry in eds:
        assert f"{entry.index:04X}h" in seen.said


@pytest.mark.parametrize("path", EVERY_TENTH, ids=lambda path: path.stem[:40])
def test_a_page_needs_nothing_from_elsewhere(path: Path) -> None:
    text = html(reference(load(path)))
    seen = Page(text)
    assert seen.tags.isdisjoint({"script", "link", "img", "iframe", "object", "embed", "base", "form"})
    assert all(link.startswith("#") for link in seen.links)
    assert not any(
        name in ("src", "srcset", "background") or name.startswith("on") for name, _ in seen.attributes
    )
    style = text[text.index("<style>") : text.index("</style>")]
    assert "url(" not in style
    assert "@import" not in style


def test_the_page_can_be_printed() -> None:
    style = html(reference(small("")))
    assert "@media print" in style
    assert "@page" in style
    assert "break-inside: avoid" in style
    assert "table-header-group" in style


def test_the_content_of_a_name_is_text_and_not_markup() -> None:
    eds = small(
        variable("2000", ParameterName=NASTY, PDOMapping="1") + STATUS.replace("0x60410010", "0x20000010")
    )
    seen = page(eds)
    assert "script" not in seen.tags
    assert "b" not in seen.tags
    assert seen.said.count(NASTY) >= 3  # contents, PDO, row
    assert "Axle <2>" in seen.said
    assert "Muster & Co" in seen.said


def test_a_pdo_is_drawn_to_scale() -> None:
    """Each byte is as wide as the next: a box begins and ends where its bits do."""
    boxes = page(small(BITS)).boxes
    unit = boxes[0][1]  # one bit
    # Bits of the frame: 1, 3, 4 (space), 32, 24.
    assert [round((left - boxes[0][0]) / unit) for left, _ in boxes] == [0, 1, 4, 8, 40]
    assert [round(width / unit) for _, width in boxes] == [1, 3, 4, 32, 24]


def test_every_box_has_its_object_as_a_tip_and_narrow_ones_a_letter() -> None:
    text = html(reference(small(BITS)))
    assert "<title>2000 Ready &quot;now&quot;, byte 0 bit 0</title>" in text
    assert re.search(r'<text class="letter"[^>]*>a</text>', text)
    assert re.search(r"<tr><td>a</td><td>byte 0 bit 0</td>", text)


def test_an_overlong_pdo_is_drawn_over_two_rows_with_a_warning() -> None:
    eds = small(communication("1800", "0x180") + mapped("1A00", "0x60640020", "0x60640020", "0x60410010"))
    seen = page(eds)
    assert len(seen.boxes) == 3
    assert "80 bits are mapped, a CAN frame holds 64" in seen.said


def test_the_head_has_identity_bit_rates_and_claimed_modes() -> None:
    said = page(builtin("gim6010-8"), 5).said
    for text in ("0x000C0B00", "125, 250, 500, 1000 kbit/s", "servo drive (CiA 402)", "cyclic sync velocity"):
        assert text in said
    modes = {row.short: (row.claimed, row.missing) for row in reference(builtin("gim6010-8")).modes}
    assert modes["pp"] == ("yes", "")
    assert modes["csp"] == ("no", "")
    assert modes["ip"] == ("yes", "60C1h")


def test_values_are_those_of_the_node() -> None:
    assert "0x00000085 ($NODEID+0x80)" in page(builtin("generic-cia402"), 5).said
    assert "0x00000085" not in page(builtin("generic-cia402")).said


def test_terms_of_the_profile_are_explained_once_and_linked_to_later() -> None:
    second = variable("6841", ParameterName="Statusword 2", DataType="0x6", AccessType="ro")
    eds = small(second + variable("6840", ParameterName="Controlword 2", DataType="0x6"))
    seen = page(eds)
    assert seen.said.count("quick stop active") == 1
    assert seen.said.count("fault reset (rising edge)") == 1
    assert "bits and values: see 6041h" in seen.said
    assert "#o6041" in seen.links


def test_a_page_names_the_pdo_of_an_object_and_its_definition_in_the_standard() -> None:
    said = page(small(STATUS)).said
    assert "in: TPDO1 bytes 3-6" in said
    assert "standard: CiA 402: Position actual value, INTEGER32, ro, TPDO" in said


def test_findings_are_listed_with_line_and_remedy() -> None:
    eds = small(variable("2000", DefaultValue="12x"))
    seen = page(eds)
    (finding,) = eds.findings
    for text in (finding.rule, str(finding.line), finding.message, finding.remedy, "(1 error)"):
        assert text in seen.said


def test_findings_of_a_check_replace_those_of_the_reading() -> None:
    given = EdsFinding("X001", Severity.NOTE, 7, 1, "a thing of note", "leave it")
    whole = reference(small(""), None, [given])
    assert whole.verdict == "1 note"
    assert "a thing of note" in Page(html(whole)).said
    assert reference(small("")).verdict == "nothing was found wrong"


def test_like_sub_indices_share_a_row_unless_one_of_them_is_mapped() -> None:
    subs = [variable(f"2100sub{at}", ParameterName=f"Value {at}", PDOMapping="1") for at in range(1, 6)]
    rows = reference(small(record("2100", *subs))).areas[1].objects[0].rows
    assert [row.address for row in rows] == ["01-05"]
    mapped_too = communication("1800", "$NODEID+0x180") + mapped("1A00", "0x21000320")
    rows = reference(small(record("2100", *subs) + mapped_too)).areas[1].objects[0].rows
    assert [row.address for row in rows] == ["01", "02", "03", "04", "05"]


def tables(text: str) -> list[list[str]]:
    """Return the runs of lines that are tables."""
    return [run.splitlines() for run in re.findall(r"(?:^\|.*\n)+", text + "\n", re.MULTILINE)]


@pytest.mark.parametrize("path", EVERY_TENTH, ids=lambda path: path.stem[:40])
def test_tables_of_markdown_have_one_number_of_columns(path: Path) -> None:
    eds = load(path)
    text = markdown(reference(eds, 5))
    for table in tables(text):
        assert len({len(re.findall(r"(?<!\\)\|", row)) for row in table}) == 1, table[:3]
    for index in eds.objects:
        assert f'<a id="o{index:04X}"></a>' in text
    anchors = set(re.findall(r'<a id="([^"]+)"></a>', text))
    assert set(re.findall(r"\]\(#([^)]+)\)", text)) <= anchors


def test_markdown_draws_the_pdos_and_escapes_names() -> None:
    text = markdown(reference(small(BITS + variable("2003", ParameterName=NASTY))))
    assert "│a│2001 │" in text
    assert "\\<script\\>" in text
    assert "\\*bold\\*" in text
    assert "<script>" not in text


@pytest.mark.skipif(not CORPUS, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
def test_every_real_file_becomes_a_page_with_a_drawing_for_each_pdo() -> None:
    for path in CORPUS:
        eds = load(path)
        text = html(reference(eds, 5))
        drawn = [each for each in layout.layouts(eds, 5) if each.bits]
        assert text.count("<svg ") == text.count("</svg>") == len(drawn), path.name


def test_no_cell_breaks_within_a_word_but_for_those_of_fixed_width() -> None:
    """On a phone a table whose cells may break anywhere has columns of one letter; objects are below each other there."""
    style = (Path(reference_package.__file__).parent / "style.css").read_text()
    assert re.search(r"^th, td \{[^}]*overflow-wrap: break-word", style, re.M)
    phone = style[style.index("(max-width: 50rem)") : style.index("@page")]
    for selector in ("table.objects > tbody > tr {", "table.findings tr {", "table.plain {"):
        assert selector in phone
