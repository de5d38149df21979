"""Writing: an unchanged file, and a model without a file as an EDS that other tools read correctly."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import pytest

from axisbus.cia301.datatypes import DataType
from axisbus.eds import Eds, Number, Object, ObjectType, Variable, loads, writer
from axisbus.eds.builtin import names, resolve
from axisbus.eds.io import reader
from axisbus.errors import ArgumentError
from kit.eds.texts import HEAD, canopen_facts, import_text, our_facts, read, record, variable


def by_hand() -> Eds:
    """A model made in a program: every kind of object and value."""
    plain = Variable(0x1000, 0, "Device type", DataType.UNSIGNED32, "ro", Number(0x20192))
    kinds = {
        1: Variable(
            0x2000, 1, "signed", DataType.INTEGER16, "rw", Number(-5), Number(7), Number(-10), Number(10)
        ),
        2: Variable(0x2000, 2, "real", DataType.REAL32, "rww", 0.5, pdo_mapping=True),
        3: Variable(0x2000, 3, "text", DataType.VISIBLE_STRING, "const", "a=b 100%"),
        4: Variable(0x2000, 4, "bytes", DataType.OCTET_STRING, "ro", b"\x01\xff"),
        5: Variable(0x2000, 5, "time", DataType.TIME_OF_DAY, "ro", b"\x01\x00\x00\x00\x00\x00"),
        0x1A: Variable(
            0x2000,
            0x1A,
            "formula",
            DataType.UNSIGNED32,
            "rw",
            Number(0x180, plus_node_id=True),
            object_flags=1,
        ),
    }
    record = {0: Variable(0x2000, 0, "highest", DataType.UNSIGNED8, "ro", Number(0x1A)), **kinds}
    program = Variable(
        0x1F50,
        0,
        "Program",
        DataType.DOMAIN,
        "wo",
        object_type=ObjectType.DOMAIN,
        more={"downloadfile": "a.bin"},
    )
    objects = {
        0x1000: Object(0x1000, "Device type", ObjectType.VAR, {0: plain}),
        0x1F50: Object(0x1F50, "Program", ObjectType.DOMAIN, {0: program}),
        0x2000: Object(0x2000, "All", ObjectType.RECORD, record, links=(0x1000,), denotation="mine"),
    }
    info = {
        "deviceinfo": {"vendorname": "me", "vendornumber": "0x1A", "productnumber": "", "baudrate_500": "1"},
        "dummyusage": {"dummy0005": "1"},
        "comments": {"lines": "9", "line1": "first", "line3": "third"},
        "toolinfos": {"x": "1"},
    }
    return Eds("by hand", objects, info, 5)


def test_a_model_made_in_a_program_is_written_and_read_without_a_difference() -> None:
    eds = by_hand()
    data = writer.dumps(eds)
    again = loads(data, "again.dcf")
    assert [finding.rule for finding in again.findings] == ["S012"]  # [toolinfos] belongs to no known tool
    assert our_facts(again, 5) == our_facts(eds, 5)
    assert (again.node_id, again.dummies, again.objects[0x2000].links) == (5, {5}, (0x1000,))
    assert again.objects[0x2000].denotation == "mine"
    domain = again.get(0x1F50)
    assert domain is not None
    assert domain.more == {"downloadfile": "a.bin"}
    assert again.info["optionalobjects"] == {"supportedobjects": "1", "1": "0x1F50"}
    assert again.info["manufacturerobjects"] == {"supportedobjects": "1", "1": "0x2000"}
    assert again.info["comments"] == {"lines": "2", "line1": "first", "line2": "third"}


def test_canopen_reads_the_written_model_as_it_was_meant() -> None:
    eds = by_hand()
    text = writer.dumps(eds).decode()
    theirs = canopen_facts(text, 5)
    ours = our_facts(eds, 5)
    ours[0x2000, 5] = (*ours[0x2000, 5][:4], 1, *ours[0x2000, 5][5:])  # it reads times as integers
    assert theirs == ours
    assert import_text(text, 5).device_information.vendor_number == 0x1A


def test_the_first_lines_are_as_the_standard_prints_them() -> None:
    text = writer.dumps(by_hand()).decode()
    assert text.startswith(
        "[DeviceInfo]\nVendorName=me\nVendorNumber=26\nBaudRate_500=1\n\n[DeviceComissioning]\nNodeID=5\n\n"
    )
    assert "[2000sub1A]\nParameterName=formula\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\n" in text
    assert "DefaultValue=$NODEID+0x180\n" in text


def test_a_file_is_written_as_it_was_read() -> None:
    data = ("; mine\r\n" + HEAD.replace("\n", "\r\n") + "[DeviceInfo]\r\nX = 1").encode()
    reading = reader.read(data, "x.eds")
    assert writer.dumps(reading) == writer.dumps(reading.eds) == writer.dumps(reading.document) == data
    assert writer.dumps(loads(data, "other.eds")) == data


def test_a_read_model_with_other_objects_is_written_again() -> None:
    eds = read(variable("2000"))
    fewer = replace(eds, objects={0x1000: eds.objects[0x1000]})
    assert list(loads(writer.dumps(fewer), "x.eds").objects) == [0x1000]
    named = replace(eds, info={"deviceinfo": {"vendorname": "other"}})
    assert loads(writer.dumps(named), "x.eds").info["deviceinfo"] == {"vendorname": "other"}


@pytest.mark.parametrize("name", names())
def test_the_builtin_files_written_again_are_read_without_a_difference(name: str) -> None:
    eds = reader.load(resolve(f"builtin:{name}", Path()))
    text = writer.dumps(replace(eds, objects=dict(eds.objects))).decode()
    again = loads(text.encode(), "again.eds")
    assert again.findings == ()
    assert our_facts(again, 5) == our_facts(eds, 5) == canopen_facts(text, 5)
    assert again.identity == eds.identity


@pytest.mark.parametrize(
    ("info", "name", "words"),
    [
        ({"deviceinfo": {"vendorname": "Müller"}}, "x", "not ASCII"),
        ({"deviceinfo": {"vendornumber": "e-RIO"}}, "x", "VendorNumber='e-RIO' is not a number"),
        ({}, "a\nb", "ParameterName"),
        ({}, " a", "ParameterName"),
        ({"a]": {}}, "x", "not a name of a section"),
    ],
)
def test_a_value_that_an_eds_cannot_hold_is_refused(
    info: dict[str, dict[str, str]], name: str, words: str
) -> None:
    entry = Variable(0x2000, 0, name, DataType.UNSIGNED8, "rw")
    with pytest.raises(ArgumentError, match=words):
        writer.dumps(Eds("x", {0x2000: Object(0x2000, name, ObjectType.VAR, {0: entry})}, info))


def test_a_pickled_model_is_the_same_in_another_process() -> None:
    eds = read(record("2000", variable("2000sub1", DefaultValue="4x0")))
    again = pickle.loads(pickle.dumps(eds))
    assert again.objects == eds.objects
    assert again.findings == eds.findings != ()
    assert writer.dumps(again) == writer.dumps(eds)


@pytest.mark.parametrize("value", [float("inf"), float("nan")])
def test_an_invalid_number_is_refused(value: float) -> None:
    entry = Variable(0x2000, 0, "x", DataType.REAL32, "rw", value)
    with pytest.raises(ArgumentError, match="cannot be written in an EDS"):
        writer.dumps(Eds("x", {0x2000: Object(0x2000, "x", ObjectType.VAR, {0: entry})}, {}))
