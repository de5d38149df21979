"""Changing a file: the lines that were meant, in the file's own style, and not one byte more."""

from __future__ import annotations

import codecs

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.eds import writer
from axisbus.eds.io import edit, text
from axisbus.eds.io.text import EdsText
from axisbus.errors import ArgumentError
from kit.eds.texts import HEAD, HEAD_LINES, variable


def document(content: str | bytes) -> EdsText:
    return text.parse(text.decode(content if isinstance(content, bytes) else content.encode()))


def changed(content: str | bytes, *changes: edit.LineEdit) -> bytes:
    return writer.dumps(edit.apply(document(content), changes))


SPEED = "[6081]\n  ParameterName = Profile velocity \nDataType=7\naccesstype=rw\nDefaultValue=\t10 \n\n[6083]\nDataType=7\n"


def test_a_changed_value_changes_its_characters_and_nothing_else() -> None:
    file = document(SPEED)
    speed = file.sections["6081"]
    assert changed(SPEED, edit.set_value(file, speed, "DEFAULTVALUE", "0x1F")) == SPEED.replace(
        "10", "0x1F"
    ).encode("ascii")
    assert changed(SPEED, edit.set_value(file, speed, "ParameterName", "v")) == SPEED.replace(
        "Profile velocity", "v"
    ).encode("ascii")


def test_an_empty_value_is_filled_and_a_full_one_emptied() -> None:
    content = "[6081]\nDefaultValue= \nDataType=7"
    file = document(content)
    section = file.sections["6081"]
    assert changed(content, edit.set_value(file, section, "defaultvalue", "5")) == (
        b"[6081]\nDefaultValue= 5\nDataType=7"
    )
    assert changed(content, edit.set_value(file, section, "datatype", "")) == (
        b"[6081]\nDefaultValue= \nDataType="
    )


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("end", ["", "\n", "\n\n"])
def test_a_new_key_is_inserted_behind_the_last_entry_with_the_files_line_end(newline: str, end: str) -> None:
    content = ("[6081]\nDataType=7\n; c\n\n[6083]\nDataType=7" + end).replace("\n", newline)
    file = document(content)
    changes = [edit.set_value(file, file.sections[name], "DefaultValue", "1") for name in ("6081", "6083")]
    expected = "[6081]\nDataType=7\nDefaultValue=1\n; c\n\n[6083]\nDataType=7\nDefaultValue=1" + end
    assert changed(content, *changes) == expected.replace("\n", newline).encode()


def test_a_new_key_is_spelt_and_spaced_like_its_neighbours() -> None:
    content = "[6081]\n\tparametername = Speed\n\tdatatype = 7\n"
    file = document(content)
    assert changed(content, edit.set_value(file, file.sections["6081"], "DefaultValue", "1")) == (
        content + "\tdefaultvalue = 1\n"
    ).encode("ascii")


def test_a_section_without_entries_takes_its_first_below_its_header() -> None:
    content = "[DeviceInfo]\n; nothing\n[1000]\nDataType = 7\n"
    file = document(content)
    change = edit.insert_key(file, file.sections["deviceinfo"], "VendorName", "me")
    assert changed(content, change) == b"[DeviceInfo]\nVendorName = me\n; nothing\n[1000]\nDataType = 7\n"


def test_keys_are_removed_with_their_repetitions() -> None:
    content = "[6081]\nDefaultValue=1\nDataType=7\ndefaultvalue=2\n;DefaultValue=3\n"
    file = document(content)
    changes = edit.remove_keys(file, file.sections["6081"], ["DefaultValue"])
    assert changed(content, *changes) == b"[6081]\nDataType=7\n;DefaultValue=3\n"


@pytest.mark.parametrize(
    ("end", "added"), [("", "\n\n[B]\nx=1"), ("\n", "\n[B]\nx=1\n"), ("\n\n", "[B]\nx=1\n")]
)
def test_a_section_added_at_the_end_follows_one_blank_line(end: str, added: str) -> None:
    content = "[1000]\nDataType=7" + end
    assert (
        changed(content, edit.add_section(document(content), "B", {"x": "1"})) == (content + added).encode()
    )


def test_a_section_before_another_is_inserted_above_the_comment_of_that_one() -> None:
    content = "[DeviceInfo]\r\nVendorName=me\r\n\r\n; types\r\n[1000]\r\nDataType=7\r\n"
    file = document(content)
    change = edit.add_section(file, "DummyUsage", {"Dummy0001": "0"}, before=file.sections["1000"])
    assert (
        changed(content, change)
        == content.replace("; types", "[DummyUsage]\r\nDummy0001=0\r\n\r\n; types").encode()
    )


def test_several_sections_are_added_in_one_change() -> None:
    content = "[1000]\nDataType=7\n"
    change = edit.add_sections(document(content), {"A": {"x": "1"}, "B": {}})
    assert changed(content, change) == b"[1000]\nDataType=7\n\n[A]\nx=1\n\n[B]\n"


def test_a_removed_section_takes_its_blank_lines_but_not_the_next_ones_comment() -> None:
    content = "[1000]\nDataType=7\n\n[1001]\n; inside\nDataType=5\n\n\n; of 1002\n[1002]\nDataType=7\n"
    file = document(content)
    assert changed(content, edit.remove_section(file, file.sections["1001"])) == (
        b"[1000]\nDataType=7\n\n; of 1002\n[1002]\nDataType=7\n"
    )


@pytest.mark.parametrize(
    ("header", "renamed"),
    [("[ A ] ; x", "[B] ; x"), ("  [A]", "[B]"), ("[A", "[B]"), ("[A]\r", "[B]\r")],
)
def test_a_renamed_section_begins_in_column_one(header: str, renamed: str) -> None:
    content = f"{header}\nx=1\r\n"
    file = document(content)
    assert (
        changed(content, edit.rename_section(file, file.sections["a"], "B")) == f"{renamed}\nx=1\r\n".encode()
    )


def test_letters_stay_in_the_encoding_of_the_file() -> None:
    content = codecs.BOM_UTF16_LE + "[6081]\r\nParameterName=Größe\r\n".encode("utf-16-le")
    file = document(content)
    change = edit.set_value(file, file.sections["6081"], "ParameterName", "Höhe")
    assert changed(content, change) == codecs.BOM_UTF16_LE + "[6081]\r\nParameterName=Höhe\r\n".encode(
        "utf-16-le"
    )


def test_a_letter_that_the_encoding_has_not_is_refused() -> None:
    file = document(SPEED)
    change = edit.set_value(file, file.sections["6081"], "ParameterName", "Größe")
    with pytest.raises(ArgumentError, match="ASCII, which has no 'ö'"):
        edit.apply(file, [change])


@pytest.mark.parametrize("value", ["a\nb", "a\rb", " a", "a ", "a\0", "\x85", "\u2028"])
def test_a_value_that_would_not_be_read_back_is_refused(value: str) -> None:
    file = document(SPEED)
    with pytest.raises(ArgumentError, match="the value of DefaultValue"):
        edit.set_value(file, file.sections["6081"], "DefaultValue", value)


@pytest.mark.parametrize("key", ["", "a=b", ";a", "[a", "a\n"])
def test_an_invalid_key_is_refused(key: str) -> None:
    file = document(SPEED)
    with pytest.raises(ArgumentError):
        edit.set_value(file, file.sections["6081"], key, "1")


@pytest.mark.parametrize("name", ["", "a]", "[a", "a\nb", " a"])
def test_an_invalid_section_name_is_refused(name: str) -> None:
    with pytest.raises(ArgumentError):
        edit.add_section(document(SPEED), name, {})


def test_two_changes_of_one_line_are_refused() -> None:
    file = document(SPEED)
    change = edit.set_value(file, file.sections["6081"], "DefaultValue", "1")
    with pytest.raises(ArgumentError, match="two changes touch line 5"):
        edit.apply(file, [change, change])


def test_the_changed_document_knows_its_new_lines() -> None:
    file = document(HEAD + variable("2000"))
    after = edit.apply(file, [edit.set_value(file, file.sections["1000"], "DefaultValue", "0x192")])
    assert after.sections["1000"].entries["defaultvalue"] == "0x192"
    assert after.sections["2000"].line == HEAD_LINES + 2


LINES = st.lists(
    st.sampled_from(["[A]", "[b]", "x=1", " y = 2 ", ";c", "", "?", "x=3", "[A", "z="]), max_size=12
)


@given(
    LINES,
    st.sampled_from(["\n", "\r\n", "\r"]),
    st.sampled_from(["x", "y", "new"]),
    st.sampled_from(["", "7"]),
)
def test_a_set_value_is_read_back_from_any_lines(
    lines: list[str], newline: str, key: str, value: str
) -> None:
    file = document(newline.join(["[1000]", "q=1", *lines]))
    for name, section in file.sections.items():
        after = edit.apply(file, [edit.set_value(file, section, key, value)])
        again = text.parse(text.decode(writer.dumps(after)))
        assert list(again.lines) == list(after.lines)
        assert {**section.entries, key: value} == again.sections[name].entries
        others = [one for one in file.sections if one != name]
        assert all(again.sections[one].entries == file.sections[one].entries for one in others)
        assert abs(len(again.lines) - len(file.lines)) == (key not in section.entries)


@given(LINES, st.sampled_from(["\n", "\r\n", "\r"]))
def test_a_section_is_added_to_any_lines_and_removed_again(lines: list[str], newline: str) -> None:
    file = document(newline.join(["[1000]", "q=1", *lines]))
    after = edit.apply(file, [edit.add_section(file, "New", {"k": "v"})])
    assert after.sections["new"].entries == {"k": "v"}
    assert list(after.sections) == [*file.sections, "new"]
    back = edit.apply(after, [edit.remove_section(after, after.sections["new"])])
    assert {name: section.entries for name, section in back.sections.items()} == {
        name: section.entries for name, section in file.sections.items()
    }
