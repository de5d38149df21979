"""The text for canopen: accepted whatever the file was like, and read as the model says."""

from __future__ import annotations

import configparser
from pathlib import Path

import pytest

from axisbus.eds import canopen_text, loads
from axisbus.eds.builtin import names, resolve
from axisbus.eds.io.reader import load
from kit.eds.texts import HEAD, canopen_facts, import_text, our_facts, read, record, variable

DEFECTS = (
    "[DummyUsage]\nDummy0005=1\n\n[Comments]\nLines=\n\n"
    + variable("2000", DefaultValue="010")
    + variable("2001", DataType="4", DefaultValue="0xFFFFFFFF", LowLimit="0x80000000", HighLimit="0x7FFFFFFF")
    + variable("2002", DefaultValue="0x80+$NODEID")
    + variable("2003", DefaultValue="$MY_NODE_ID+0x200")
    + variable("2004", ParameterName="50% of [rated] = torque", DefaultValue="5 ; five")
    + variable("2005", DataType="0x0009", DefaultValue="a=b # c")
    + variable("2006", DataType="0x0008", DefaultValue="0x3F800000")
    + variable("2007", DataType="0x000F", DefaultValue="0x0102")
    + variable("2008", DataType="0x0010", DefaultValue="-2")
    + variable("2008", DefaultValue="2")
    + "[2009]\nparametername=Keys in lower case\ndatatype=6\naccesstype=RW\ndefaultvalue=3\npdomapping=1\n\n"
    + variable("200A", LowLimit="0", HighLimit="0")
    + variable("200B", DefaultValue="$NODEID", ParameterValue="9")
    + variable("200Csub1")
    + record("200D", variable("200DSub0A", DefaultValue="4"), variable("200Dsub02"))
    + variable("200E", ObjectType="0x8", CompactSubObj="3", DataType="5")
    + "[200EName]\nNrOfEntries=1\n3=Third\n\n[200EValue]\nNrOfEntries=1\n2=8\n\n"
    + variable("200F", ObjectType="0x77")
)


def test_every_defect_is_fixed_to_the_values_that_we_read() -> None:
    eds = read(DEFECTS)
    expected = our_facts(eds, 5)
    assert canopen_facts(canopen_text(eds), 5) == expected
    assert expected[0x2000, 0][4] == 8
    assert expected[0x2001, 0][4:] == (-1, None, -2147483648, 2147483647)
    assert expected[0x2002, 0][4] == 0x85
    assert expected[0x2003, 0][4] == 0x205
    assert expected[0x2004, 0][0] == "50% of [rated] = torque"
    assert expected[0x200B, 0][4:6] == (5, 9)
    assert expected[0x200E, 2][5] == 8


@pytest.mark.parametrize(
    "defect", ["[DummyUsage]\nDummy0005=1\n", variable("2000") * 2, variable("200Csub1")]
)
def test_canopen_alone_refuses_texts_that_we_fix(defect: str) -> None:
    with pytest.raises((configparser.Error, KeyError, ValueError)):
        import_text(HEAD + defect, 5)
    assert (0x1000, 0) in canopen_facts(canopen_text(read(defect)), 5)


def test_values_that_canopen_cannot_hold_are_written_in_the_nearest_form() -> None:
    eds = read(
        variable("2000", DataType="0x0023")
        + variable("2001", ParameterName="with ; semicolon")
        + variable("2002", DataType="0x000C", DefaultValue="256")
        + record("2003", variable("2003sub1"), kind="0x6")
    )
    facts = canopen_facts(canopen_text(eds), 5)
    assert facts[0x2000, 0][1] == 0x0F
    assert facts[0x2001, 0][0] == "with; semicolon"
    assert facts[0x2002, 0][4] == 256
    assert (0x2003, 1) in facts


def test_device_facts_reach_canopen() -> None:
    eds = loads(
        (HEAD.replace("VendorNumber=1", "VendorNumber=0x1A\nProductName=Axis; 2\nBaudRate_500=1\nNrOfRXPDO=") + DEFECTS).encode()
        + b"[DeviceComissioning]\nNodeID=9\nBaudrate=500\n",
        "x.dcf",
    )  # fmt: skip
    dictionary = import_text(canopen_text(eds), None)  # type: ignore[arg-type]
    assert dictionary.device_information.vendor_number == 0x1A
    assert dictionary.device_information.product_name == "Axis; 2"
    assert dictionary.device_information.allowed_baudrates == {500_000}
    assert (dictionary.node_id, dictionary.bitrate) == (9, 500_000)
    assert {index for index in dictionary if index < 8} == {5}


def test_the_text_is_made_once_for_all_nodes_of_a_type() -> None:
    data = (HEAD + DEFECTS).encode()
    assert canopen_text(loads(data, "a.eds")) is canopen_text(loads(data, "b.eds"))


@pytest.mark.parametrize("name", names())
def test_canopen_reads_the_builtin_files_as_we_do(name: str) -> None:
    path = resolve(f"builtin:{name}", Path())
    eds = load(path)
    assert canopen_facts(path.read_text(), 5) == our_facts(eds, 5)
    assert canopen_facts(canopen_text(eds), 5) == our_facts(eds, 5)
