"""From an EDS to the DCF of one node and back: only the given values change, and only writable ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.eds import assign, builtin, concise, concise_dcf_values, dcf, writer
from axisbus.eds.dcf import Settings
from axisbus.eds.io import reader
from axisbus.eds.io import text as eds_text
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.model import Number
from axisbus.errors import ArgumentError, EdsError, LimitError
from kit.corpus import FILES
from kit.eds.texts import HEAD, canopen_facts, import_text, our_facts, record, variable

SPEED = variable("6081", ParameterName="Profile velocity", DefaultValue="10", LowLimit="1", HighLimit="5000")
LIST = "[2000]\nParameterName=List\nObjectType=8\nDataType=6\nAccessType=rw\nCompactSubObj=3\n\n"


def file(body: str = SPEED, head: str = HEAD) -> EdsParseResult:
    return reader.read((head + body).encode(), "drive.eds")


def text(reading: EdsParseResult) -> str:
    return writer.dumps(reading).decode()


def test_a_dcf_has_the_node_and_the_value_and_all_else_as_it_was() -> None:
    eds = file()
    made = dcf.make(eds, Settings(5, 500, "lift"), [(assign.entry(eds.eds, "0x6081"), "1000")])
    commissioning = "[DeviceComissioning]\nNodeID=5\nNodeName=lift\nBaudrate=500\n\n"
    assert text(made) == HEAD.replace("[1000]", commissioning + "[1000]") + SPEED.replace(
        "HighLimit=5000\n", "HighLimit=5000\nParameterValue=1000\n"
    )
    assert made.eds.node_id == 5
    assert [(each.index, each.parameter_value) for each in dcf.differing(made.eds)] == [
        (0x6081, Number(1000))
    ]
    assert text(dcf.to_eds(made)) == text(eds)


def test_names_of_files_are_written_to_the_file_info_and_read_back() -> None:
    head = "[FileInfo]\nFileName=drive.eds\nFileVersion=1\n\n" + HEAD
    eds = file(head=head)
    made = dcf.make(eds, Settings(5, file_name="lift.dcf", last_eds="drive.eds"))
    assert made.eds.info["fileinfo"] == {"filename": "lift.dcf", "fileversion": "1", "lasteds": "drive.eds"}
    assert text(dcf.to_eds(made, "drive.eds")) == text(eds)


def test_a_dcf_made_of_a_dcf_keeps_keys_that_are_not_set() -> None:
    first = dcf.make(
        file(), Settings(5, 500, "lift", net_number=3), [(file().eds.objects[0x6081].subs[0], "7")]
    )
    again = dcf.make(first, Settings(6))
    assert again.eds.info["devicecomissioning"] == {
        "nodeid": "6",
        "nodename": "lift",
        "baudrate": "500",
        "netnumber": "3",
    }
    assert text(again) == text(first).replace("NodeID=5", "NodeID=6")


def test_the_section_is_spelt_as_the_standard_has_it() -> None:
    made = dcf.make(file("[DeviceCommissioning]\nNodeID=9\n\n" + SPEED), Settings(5))
    assert "[DeviceComissioning]\nNodeID=5\n" in text(made)
    assert "Commissioning" not in text(made)


def test_compact_sub_indices_get_their_values_in_a_list() -> None:
    eds = file(LIST + SPEED)
    entries = [(assign.at(eds.eds, 0x2000, 3), "30"), (assign.at(eds.eds, 0x2000, 1), "0x10")]
    made = dcf.make(eds, Settings(5), entries)
    assert "CompactSubObj=3\n\n[2000Value]\nNrOfEntries=2\n3=30\n1=0x10\n\n[6081]" in text(made)
    found = made.eds.objects[0x2000].subs
    assert [found[sub].parameter_value for sub in (1, 2, 3)] == [Number(16), None, Number(30)]
    again = dcf.make(made, Settings(5), [(assign.at(made.eds, 0x2000, 1), "17")])
    assert text(again) == text(made).replace("1=0x10", "1=17")
    assert text(dcf.to_eds(again)) == text(eds)


@pytest.mark.parametrize("first", [True, False], ids=["new lists", "existing lists"])
def test_ten_times_as_many_values_in_lists_take_ten_times_as_many_steps(
    monkeypatch: pytest.MonkeyPatch, first: bool
) -> None:
    """Counted are the lines that are taken apart; one pass over the file for each value would make it a hundred times."""
    counts = [_steps(monkeypatch, values, first) for values in (25, 250)]
    assert counts[1] < 15 * counts[0]


def _steps(monkeypatch: pytest.MonkeyPatch, values: int, first: bool) -> int:
    indices = range(0x2000, 0x2008)
    body = "".join(
        LIST.replace("2000", f"{index:04X}").replace("CompactSubObj=3", f"CompactSubObj={values}")
        + ("" if first else f"[{index:04X}Value]\nNrOfEntries=1\n1=7\n\n")
        for index in indices
    )
    reading = file(body + SPEED)
    texts = {(index, sub): str(index + sub) for index in indices for sub in range(1, values + 1)}
    steps = 0
    apart = eds_text.entry_of

    def counted(raw: str) -> tuple[str, str]:
        nonlocal steps
        steps += 1
        return apart(raw)

    with monkeypatch.context() as patch:
        patch.setattr(eds_text, "entry_of", counted)
        made = dcf.record(reading, Settings(5), texts)
    found = {key: made.eds.objects[key[0]].subs[key[1]].parameter_value for key in texts}
    assert found == {key: Number(int(value)) for key, value in texts.items()}
    assert text(made).count(f"\nNrOfEntries={values}\n") == len(indices)
    return steps


def test_a_value_of_an_implied_pdo_cannot_be_written_to_a_dcf() -> None:
    eds = file(head=HEAD.replace("VendorNumber=1", "CompactPDO=3\nNrOfRXPDO=1"))
    with pytest.raises(EdsError, match="no place for a value of 1400h:02"):
        dcf.make(eds, Settings(5), [(assign.at(eds.eds, 0x1400, 2), "1")])


@pytest.mark.parametrize(
    ("settings", "error", "words"),
    [
        (Settings(0), ArgumentError, "0 is not a node ID"),
        (Settings(128), ArgumentError, "128 is not a node ID"),
        (Settings(5, 300), ArgumentError, "300 kbit/s is not a bit rate"),
        (Settings(5, 1000), EdsError, "does not support 1000 kbit/s"),
        (Settings(5, net_number=-1), ArgumentError, "-1 is not a network number"),
        (Settings(5, node_name="a\nb"), ArgumentError, "NodeName"),
        (Settings(5, node_name="Müller"), ArgumentError, "ASCII"),
    ],
)
def test_a_setting_out_of_range_is_refused(settings: Settings, error: type[Exception], words: str) -> None:
    eds = file(head=HEAD.replace("VendorNumber=1", "BaudRate_500=1\nBaudRate_1000=0"))
    with pytest.raises(error, match=words):
        dcf.make(eds, settings)


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        ("6081", (0x6081, 0)),
        ("0x6081", (0x6081, 0)),
        ("6081h", (0x6081, 0)),
        ("profile VELOCITY", (0x6081, 0)),
        ("6099:1", (0x6099, 1)),
        ("0x6099:01", (0x6099, 1)),
        ("6099sub1", (0x6099, 1)),
        ("Homing speeds.Slow", (0x6099, 1)),
    ],
)
def test_an_entry_is_found_by_number_and_by_name(wanted: str, found: tuple[int, int]) -> None:
    speeds = record("6099", variable("6099sub0", DataType="5"), variable("6099sub1", ParameterName="Slow"))
    eds = file(SPEED + speeds.replace("ParameterName=Record", "ParameterName=Homing speeds")).eds
    entry = assign.entry(eds, wanted)
    assert (entry.index, entry.subindex) == found


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ("6082", "has no object 6082h:00"),
        ("6081:1", "has no object 6081h:01"),
        ("Profile velcity", "did you mean 'profile velocity'"),
        ("Thing", r"several objects(.|\n)*2000h:00 \(Thing\), 2001h:00 \(Thing\)"),
    ],
)
def test_an_entry_that_is_not_there_or_not_alone_is_refused(wanted: str, words: str) -> None:
    eds = file(SPEED + variable("2000") + variable("2001")).eds
    with pytest.raises(ArgumentError, match=words):
        assign.entry(eds, wanted)


@pytest.mark.parametrize(
    ("data_type", "given", "written"),
    [
        ("7", "0x3E8", "0x3E8"),
        ("7", "$nodeid+0x200", "$NODEID+0x200"),
        ("7", "0x200 + $NODEID", "$NODEID+0x200"),
        ("7", "$NODEID", "$NODEID+0x0"),
        ("2", "0xFF", "-1"),
        ("8", "0.25", "0.25"),
        ("9", "a=b; c", "a=b; c"),
        ("0xA", "01 ff", "01 ff"),
        ("0xF", "00FF", "00FF"),
    ],
)
def test_a_value_is_taken_in_every_clear_spelling(data_type: str, given: str, written: str) -> None:
    entry = file(variable("2000", DataType=data_type)).eds.objects[0x2000].subs[0]
    assert assign.text_for(entry, given, 5) == written


@pytest.mark.parametrize(
    ("keys", "given", "error", "words"),
    [
        ({"AccessType": "ro"}, "1", ArgumentError, "cannot be written"),
        ({"AccessType": "const"}, "1", ArgumentError, "its access is const"),
        ({}, "", ArgumentError, "it is empty"),
        ({}, "abc", ArgumentError, "not an integer"),
        ({}, "4x0", ArgumentError, "not an integer"),
        ({}, "010", ArgumentError, "octal"),
        ({}, "1.0", ArgumentError, "decimal point"),
        ({}, "-1", LimitError, "negative"),
        ({"DataType": "5"}, "256", LimitError, "does not fit UNSIGNED8"),
        ({"DataType": "2"}, "200", LimitError, "INTEGER8"),
        ({"DataType": "5"}, "$NODEID+0xFC", LimitError, "257 is outside its limits"),
        ({"HighLimit": "100"}, "101", LimitError, "the highest allowed value is 100"),
        ({"LowLimit": "$NODEID+1"}, "5", LimitError, "the lowest allowed value is 6"),
        ({"DataType": "8", "LowLimit": "0.5"}, "0.25", LimitError, "0.25 is outside"),
        ({"DataType": "8"}, "nan", ArgumentError, "not a number of REAL32"),
        ({"DataType": "0xA"}, "0", ArgumentError, "not a string of octets"),
    ],
)
def test_a_value_that_the_entry_cannot_have_is_refused(
    keys: dict[str, str], given: str, error: type[Exception], words: str
) -> None:
    entry = file(variable("2000", **keys)).eds.objects[0x2000].subs[0]
    with pytest.raises(error, match=words):
        assign.text_for(entry, given, 5)


@pytest.mark.parametrize("name", builtin.names())
def test_canopen_reads_the_dcf_of_a_builtin_file_as_it_was_meant(name: str) -> None:
    eds = reader.read(reader.file_bytes(builtin.resolve(f"builtin:{name}", Path())), f"{name}.eds")
    index = (
        0x1017 if name.endswith("401") else 0x6081
    )  # producer heartbeat time of a module, profile velocity of a drive
    made = dcf.make(eds, Settings(7, 250, "z"), [(assign.entry(eds.eds, f"{index:04X}"), "1234")])
    assert canopen_facts(text(made), 7) == our_facts(made.eds, 7)
    dictionary = import_text(text(made), None)  # type: ignore[arg-type]
    assert (dictionary.node_id, dictionary.bitrate) == (7, 250_000)
    assert dictionary[index].value == 1234
    assert made.eds.findings == ()
    again = dcf.make(
        eds,
        Settings(7),
        concise_dcf_values.parameters(eds.eds, concise_dcf_values.configuration(made).writes),
    )
    assert [(each.index, each.parameter_value) for each in dcf.differing(again.eds)] == [
        (index, Number(1234))
    ]


@pytest.mark.skipif(not FILES, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
def test_real_files_become_a_dcf_and_a_concise_dcf() -> None:
    for path in FILES:
        eds = reader.read(path.read_bytes(), path.name)
        made = dcf.make(eds, Settings(5))
        assert made.eds.node_id == 5
        assert reader.read(writer.dumps(made), path.name).eds.objects.keys() == eds.eds.objects.keys(), (
            path.name
        )
        try:
            writes = concise_dcf_values.configuration(made).writes
        except (EdsError, ArgumentError):
            continue  # a value in the file that cannot be understood
        assert concise.decode(concise.encode(writes)) == writes, path.name


def test_an_object_that_takes_only_zero_is_set_to_nothing_else() -> None:
    """6086h of a drive with one profile: its limits are both 0, as its default is."""
    body = variable(
        "6086", ParameterName="Profile type", DataType="3", DefaultValue="0", LowLimit="0", HighLimit="0"
    )
    eds = file(body)
    with pytest.raises(LimitError, match="7 is outside its limits"):
        dcf.make(eds, Settings(5), [(assign.entry(eds.eds, "6086"), "7")])
