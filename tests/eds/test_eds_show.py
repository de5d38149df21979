"""The dictionary as a person reads it: areas, values, limits, PDOs drawn to the bit, searching by number and name."""

from __future__ import annotations

import re

import pytest

from axisbus.cia301.pdo import PdoCodec
from axisbus.eds import layout, load
from axisbus.eds.model import Eds
from axisbus.eds.report import export_values, overview, pdo_text, show
from axisbus.eds.report.pdo_text import ASCII
from axisbus.eds.report.show import Screen
from axisbus.errors import EdsError
from kit.eds.samples import BITS, CORPUS, EVERY_TENTH, STATUS, builtin, communication, mapped, small
from kit.eds.texts import variable


def drawn(eds: Eds, width: int = 100) -> str:
    (each,) = layout.layouts(eds, None)
    return "\n".join(pdo_text.lines(each, width))


def about(eds: Eds, wanted: str, node_id: int | None = None) -> str:
    (match,) = show.find(eds, wanted).matches
    return "\n".join(show.object_lines(eds, match, node_id, Screen()))


def test_a_pdo_is_drawn_over_the_bytes_of_its_frame() -> None:
    assert drawn(small(STATUS)) == (
        "TPDO1  $NODEID+0x180, on change (type 255)\n"
        "   0       1       2       3       4       5       6       7\n"
        "  ┌───────────────┬───────┬───────────────────────────────┐\n"
        "  │6041           │6061   │6064                           │\n"
        "  │Statusword     │Mode d…│Position                       │\n"
        "  └───────────────┴───────┴───────────────────────────────┘\n"
        "  bytes 0-1  6041  Statusword    UNSIGNED16\n"
        "  byte 2     6061  Mode display  INTEGER8\n"
        "  bytes 3-6  6064  Position      INTEGER32"
    )


def test_single_bits_are_drawn_to_scale_and_get_a_letter() -> None:
    text = drawn(small(BITS), 80)
    assert "  │a│2001 │UNSIGN…│6064" in text
    assert '  a  byte 0 bit 0     2000       Ready "now"  BOOLEAN' in text
    assert "byte 0 bits 1-3  2001       Gear" in text
    assert "byte 0 bits 4-7  UNSIGNED8  (space)" in text
    assert "bytes 1-4        6064       Position" in text
    assert "bytes 5-7        2002       Pressure     INTEGER24" in text
    # One row holds four bytes here: the position continues in the second.
    assert "  │…6064          │2002 " in text


def test_a_pdo_is_drawn_in_plain_ascii_if_the_terminal_has_no_boxes() -> None:
    (each,) = layout.layouts(small(BITS), None)
    text = "\n".join(pdo_text.lines(each, 80, ASCII))
    assert text.isascii()
    assert "|a|2001 |UNSIGN~|6064" in text


@pytest.mark.parametrize("path", EVERY_TENTH, ids=lambda path: path.stem[:40])
def test_each_mapped_object_is_drawn_at_the_bits_used_by_the_codec(path) -> None:
    """The oracle is the codec that the bus uses: all ones in one entry are all ones in its bits of the frame."""
    for each in layout.layouts(load(path), 5):
        if each.bits > 64:
            continue
        codec = PdoCodec([slot.mapped for slot in each.slots], [False] * len(each.slots))
        for number, slot in enumerate(each.slots):
            values = [0] * len(each.slots)
            values[number] = (1 << slot.bits) - 1
            frame = int.from_bytes(codec.pack(values), "little")
            assert frame == ((1 << slot.bits) - 1) << slot.first_bit


@pytest.mark.parametrize("width", [40, 60, 80, 120])
def test_no_drawing_is_wider_than_the_screen(width: int) -> None:
    for path in EVERY_TENTH:
        for each in layout.layouts(load(path), 5):
            assert max(map(len, pdo_text.draw(each, width)), default=0) <= width


@pytest.mark.parametrize("width", [60, 80, 132])
def test_no_row_of_the_tree_is_wider_than_the_screen(width: int) -> None:
    eds = builtin("gim6010-8")
    lines = list(show.tree(eds, 5, Screen(width)))
    first = next(at for at, line in enumerate(lines) if line.startswith("Communication"))
    assert max(map(len, lines[first:])) <= width
    assert any(line.endswith("…") for line in lines[first:]) == (width < 132)


def test_a_pipe_gets_whole_names() -> None:
    eds = small(
        variable("2000", ParameterName="A name of a length that no column of a terminal has room for, ever")
    )
    assert any("has room for, ever" in line for line in show.tree(eds))


def test_objects_are_grouped_by_area_and_axis() -> None:
    eds = small(
        variable("2000")
        + variable("6840", ParameterName="Controlword 2", DataType="0x6")
        + variable("6841", ParameterName="Statusword 2", DataType="0x6")
        + variable("B000")
    )
    assert [(area.title, [hex(entry.index) for entry in area.objects]) for area in overview.areas(eds)] == [
        ("Communication", ["0x1000"]),
        ("Maker's own objects", ["0x2000"]),
        ("Device profile CiA 402, axis 1", ["0x6040", "0x6041", "0x6061", "0x6064"]),
        ("Device profile CiA 402, axis 2", ["0x6840", "0x6841"]),
        ("Network and system variables", ["0xb000"]),
    ]


def test_the_head_describes_the_device() -> None:
    lines = list(show.head(builtin("gim6010-8"), None))
    assert lines[0].startswith("GIM6010-8 by CyberBeast (")
    assert "  device      servo drive (CiA 402), device type 0x00020192" in lines
    assert "  modes       pp hm ip csv cst cstca" in lines  # bits 0, 5, 6, 8, 9, 10 of 0x761
    assert "  bit rates   125, 250, 500, 1000 kbit/s" in lines


def test_without_a_value_of_6502h_the_modes_are_not_said() -> None:
    assert any("not said (6502h has no value)" in line for line in show.head(small(""), None))


def test_a_value_with_the_node_id_is_resolved_for_the_node_and_a_formula_without() -> None:
    eds = builtin("generic-cia402")
    assert "0x00000085 ($NODEID+0x80)" in about(eds, "1014", 5)
    assert "value     $NODEID+0x80" in about(eds, "1014")


def test_a_dcf_is_shown_with_values_and_defaults() -> None:
    eds = small(variable("2000", DataType="0x6", DefaultValue="10", ParameterValue="0x14"))
    assert "value     20 (DCF; default 10)" in about(eds, "2000")


def test_limits_of_the_data_type_are_no_news_in_the_tree_but_named_for_one_object() -> None:
    eds = small(variable("2000", DataType="0x5", LowLimit="0", HighLimit="255"))
    assert "[0..255]" not in "\n".join(show.tree(eds))
    assert "limits    0..255" in about(eds, "2000")
    narrow = small(variable("2000", DataType="0x5", LowLimit="1", HighLimit="9", DefaultValue="3"))
    assert any(line.endswith("3  [1..9]") for line in show.tree(narrow))


def test_like_sub_indices_are_one_row_by_default() -> None:
    eds = builtin("gim6010-8")
    assert any(":01-08" in line and "(8 alike)" in line for line in show.tree(eds))
    whole = list(show.tree(eds, None, Screen(fold=False)))
    assert not any("alike" in line for line in whole)
    assert sum(bool(re.match(r"  [├└] :", line)) for line in whole) == sum(
        len(entry.subs) for entry in eds if entry.is_record
    )


def test_a_mapping_entry_is_shown_with_its_object() -> None:
    assert any("6041:00/16 Statusword" in line for line in show.tree(small(STATUS)))


def test_one_object_is_shown_with_its_bits_states_and_pdos() -> None:
    text = about(small(STATUS), "statusword")
    assert "standard  CiA 402: Statusword, UNSIGNED16, ro, TPDO, mandatory" in text
    assert "in        TPDO1 bytes 0-1" in text
    # CiA 402-2 table 30.
    assert re.search(r"0x0027, mask 0x006F +operation enabled", text)
    assert re.search(r"0x0008, mask 0x004F +fault$", text, re.MULTILINE)
    assert re.search(r"bit 10 +target reached", text)
    assert re.search(r"bit 5 +quick stop \(0 = active\)", text)


@pytest.mark.parametrize(
    ("access", "words"),
    [("ro", "a TPDO"), ("rww", "an RPDO"), ("wo", "an RPDO"), ("rw", "a TPDO or an RPDO")],
)
def test_the_pdo_that_may_carry_an_object_is_named(access: str, words: str) -> None:
    body = variable("2000", ParameterName="Thing", AccessType=access, PDOMapping="1")
    assert f"{access}, may be mapped in {words}\n" in about(small(body), "2000")


def test_objects_of_the_second_axis_are_explained_like_those_of_the_first() -> None:
    eds = small(variable("6861", ParameterName="Mode display 2", DataType="0x2", AccessType="ro"))
    assert re.search(r"8 +cyclic sync position \(csp\)", about(eds, "6861"))


@pytest.mark.parametrize(
    "wanted", ["6041", "0x6041", "6041h", " 6041 ", "Statusword", "STATUS", "6041:0", "6041sub0"]
)
def test_an_object_is_found_by_number_and_by_name(wanted: str) -> None:
    (match,) = show.find(small(STATUS), wanted).matches
    assert match.entry.index == 0x6041


@pytest.mark.parametrize(
    ("wanted", "subs"), [("1800:1", (1,)), ("0x1800sub02", (2,)), ("1800", None), ("1800.1", (1,))]
)
def test_a_sub_index_is_found_by_number(wanted: str, subs: tuple[int, ...] | None) -> None:
    (match,) = show.find(small(STATUS), wanted).matches
    assert (match.entry.index, match.subs) == (0x1800, subs)


def test_a_word_of_hexadecimal_digits_that_is_no_index_is_a_name() -> None:
    eds = small(variable("2000", ParameterName="Feed constant"))
    assert show.find(eds, "feed").one is eds.objects[0x2000]


def test_a_search_matches_if_all_words_are_in_the_name_of_the_object_or_sub_index() -> None:
    found = show.find(builtin("gim6010-8"), "identity vendor").matches
    assert [(match.entry.index, match.subs) for match in found] == [(0x1018, (1,))]


def test_a_pdo_is_found_by_its_name() -> None:
    eds = small(STATUS)
    assert show.find(eds, "tpdo1").pdo == (False, 1)
    text = "\n".join(show.pdo_lines(layout.layouts(eds, 5)[0], Screen()))
    assert text.startswith("TPDO1  185h ($NODEID+0x180), on change (type 255)")
    assert "parameters in 1800h and 1A00h" in text


def test_the_error_for_a_missing_object_names_similar_objects() -> None:
    with pytest.raises(EdsError, match="no object 'Statuswort'") as caught:
        show.find(small(STATUS), "Statuswort")
    assert "6041h Statusword" in caught.value.remedy
    with pytest.raises(EdsError, match="no object '6042'"):
        show.find(small(STATUS), "6042")


@pytest.mark.parametrize(
    ("body", "note"),
    [
        (
            mapped("1A00", "0x60640020", "0x60640020", "0x60410010"),
            "80 bits are mapped, a CAN frame holds 64",
        ),
        (mapped("1A00", "0x60420010"), "6042:00/16 is mapped, but the file does not describe it"),
        (mapped("1A00", "0x60640010"), "6064:00/16 takes 16 bits, its type INTEGER32 has 32"),
        (mapped("1A00", "0x60410010", count="3"), "1A00h:00 counts 3 mapped objects, the file gives 1"),
        (mapped("1A00", "0x00070020"), "fills space with UNSIGNED32, which [DummyUsage] does not allow"),
        (mapped("1A00", count="0xFF"), "a DAM-MPDO: the object travels in the frame"),
        ("", "the file has no mapping parameter 1A00h"),
    ],
)
def test_a_defect_of_a_pdo_is_reported_below_its_drawing(body: str, note: str) -> None:
    assert note in drawn(small(communication("1800", "$NODEID+0x180") + body))


@pytest.mark.parametrize(
    ("cob_id", "transmission", "words"),
    [
        ("$NODEID+0x180", "0", "185h ($NODEID+0x180), with SYNC, on change (type 0)"),
        ("0x1A3", "1", "1A3h, with every SYNC (type 1)"),
        ("0x80000181", "240", "181h, switched off, with every 240. SYNC (type 240)"),
        ("0x20012345", "252", "12345h, on remote request (type 252)"),
        ("$NODEID+0x40000180", "254", "185h ($NODEID+0x180), on change (type 254)"),
    ],
)
def test_cob_id_and_transmission_are_put_in_words(cob_id: str, transmission: str, words: str) -> None:
    (each,) = layout.layouts(small(communication("1800", cob_id, transmission) + mapped("1A00")), 5)
    assert pdo_text.heading(each) == words


def test_facts_for_programs() -> None:
    eds = small(STATUS)
    entry = export_values.entry(eds.objects[0x1800], eds.objects[0x1800].subs[1], 5)
    assert {key: entry[key] for key in ("index", "subindex", "data_type", "access", "default")} == {
        "index": 0x1800,
        "subindex": 1,
        "data_type": "UNSIGNED32",
        "access": "rw",
        "default": 0x185,
    }
    assert (
        export_values.entry(eds.objects[0x1800], eds.objects[0x1800].subs[1], None)["default"]
        == "$NODEID+0x180"
    )
    (pdo,) = export_values.all_values(eds, 5)["pdos"]
    assert (pdo["name"], pdo["cob_id"], pdo["transmission_type"]) == ("TPDO1", 0x185, 255)
    assert [(slot["name"], slot["first_bit"], slot["bits"], slot["signed"]) for slot in pdo["mapping"]] == [
        ("Statusword", 0, 16, False),
        ("Mode display", 16, 8, True),
        ("Position", 24, 32, True),
    ]


@pytest.mark.skipif(not CORPUS, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
def test_every_real_file_is_shown_with_each_of_its_objects() -> None:
    for path in CORPUS:
        eds = load(path)
        text = "\n".join(show.tree(eds, None, Screen(100)))
        shown = re.findall(r"^  ([0-9A-F]{4})  ", text, re.MULTILINE)
        assert shown == [f"{index:04X}" for index in sorted(eds.objects)], path.name
