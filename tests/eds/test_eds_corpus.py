"""Real files of many makers, if a folder of them is given: all are read, written back, and read by canopen with their meaning."""

from __future__ import annotations

import configparser
import logging
import random
import re
from dataclasses import replace

import pytest

from axisbus.cia301.datatypes import DataType
from axisbus.eds import canopen_text, dcf, writer
from axisbus.eds.fix import fix
from axisbus.eds.io import edit, reader
from axisbus.errors import ArgumentError
from kit.corpus import FILES
from kit.eds.texts import canopen_facts, import_text, our_facts

pytestmark = pytest.mark.skipif(not FILES, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")

# Texts that canopen misreads though DS 306 allows them: compact sub-indices, and keys in a case other than in the standard.
MISREAD_BY_CANOPEN = re.compile(r"CompactSubObj|^Pdo", re.MULTILINE)
NO_LIMITS_IN_CANOPEN = frozenset(
    (
        DataType.REAL32,
        DataType.REAL64,
        DataType.INTEGER24,
        DataType.INTEGER40,
        DataType.INTEGER48,
        DataType.INTEGER56,
    )
)
LIBRARY_TYPES = range(1, 0x1C)


@pytest.fixture(scope="module")
def readings() -> dict[str, reader.EdsParseResult]:
    logging.getLogger("canopen").setLevel(logging.ERROR)
    return {path.name: reader.read(path.read_bytes(), path.name) for path in FILES}


def comparable(facts: dict[tuple[int, int], tuple[object, ...]]) -> dict[tuple[int, int], tuple[object, ...]]:
    """Return the facts without those that canopen cannot hold: limits of some types, types of the maker, exact times."""
    known: dict[tuple[int, int], tuple[object, ...]] = {}
    for key, (name, kind, access, mapping, default, value, low, high) in facts.items():
        if kind in NO_LIMITS_IN_CANOPEN:
            low = high = None
        if kind in (DataType.TIME_OF_DAY, DataType.TIME_DIFFERENCE):
            default = value = None
        if kind not in LIBRARY_TYPES:
            kind = int(DataType.DOMAIN)
        text = name if isinstance(name, str) else ""
        known[key] = (text, kind, access, mapping, default, value, low, high)
    return known


def test_every_file_is_read_and_written_back_byte_for_byte(
    readings: dict[str, reader.EdsParseResult],
) -> None:
    for path in FILES:
        reading = readings[path.name]
        assert reading.eds.objects
        assert writer.dumps(reading.document) == path.read_bytes(), path.name


def test_findings_point_into_the_file(readings: dict[str, reader.EdsParseResult]) -> None:
    for name, reading in readings.items():
        for finding in reading.eds.findings:
            assert 0 <= finding.line <= len(reading.document.lines), (name, finding)
            if finding.line:
                assert 1 <= finding.column <= len(reading.document.lines[finding.line - 1]) + 1, (
                    name,
                    finding,
                )


def test_every_file_reaches_canopen_as_we_read_it(readings: dict[str, reader.EdsParseResult]) -> None:
    for name, reading in readings.items():
        theirs = comparable(canopen_facts(canopen_text(reading.eds), 5))
        assert theirs == comparable(our_facts(reading.eds, 5)), name


def test_clean_files_are_read_as_by_canopen(readings: dict[str, reader.EdsParseResult]) -> None:
    compared = 0
    for path in FILES:
        eds = readings[path.name].eds
        text = path.read_bytes().decode("ascii", errors="replace").replace("\r\n", "\n")
        if eds.findings or MISREAD_BY_CANOPEN.search(text):
            continue
        try:
            theirs = canopen_facts(text, 5)
        except (configparser.Error, ValueError):
            continue  # it refuses partial [DummyUsage] and empty numbers
        assert comparable(our_facts(eds, 5)) == comparable(theirs), path.name
        compared += 1
    assert compared >= len(FILES) // 4


def test_one_changed_value_is_one_changed_line(readings: dict[str, reader.EdsParseResult]) -> None:
    chance = random.Random(306)
    for path in FILES:
        document = readings[path.name].document
        sections = [section for section in document.sections.values() if section.entries]
        for section in chance.sample(sections, min(5, len(sections))):
            key = chance.choice(list(section.entries))
            after = writer.dumps(edit.apply(document, [edit.set_value(document, section, key, "4711x")]))
            line, column = document.location(section, key)
            changed = document.lines[line - 1][: column - 1] + "4711x"
            tail = document.lines[line - 1][column - 1 :].removeprefix(section.entries[key])
            lines = [*document.lines[: line - 1], changed + tail, *document.lines[line:]]
            assert after == document.bom + document.newline.join(lines).encode(document.encoding), (
                path.name,
                section,
                key,
            )


def test_every_model_written_again_is_a_clean_file_that_canopen_reads(
    readings: dict[str, reader.EdsParseResult],
) -> None:
    written = 0
    for name, reading in readings.items():
        eds = replace(reading.eds, objects=dict(reading.eds.objects))
        try:
            data = writer.dumps(eds)
        except ArgumentError:
            continue  # a text that is not ASCII, or an invalid number in [DeviceInfo]
        written += 1
        again = reader.read(data, name)
        assert our_facts(again.eds, 5) == our_facts(eds, 5), name
        assert comparable(canopen_facts(data.decode(), 5)) == comparable(our_facts(eds, 5)), name
    assert written >= len(FILES) * 9 // 10


def accepted(data: bytes) -> bool:
    """Whether canopen reads these bytes without an exception or a complaint."""
    try:
        import_text(data.decode("latin-1").replace("\r\n", "\n"), 5)
    except (configparser.Error, ValueError, LookupError, Warning):
        return False
    return True


def test_files_that_canopen_reads_it_still_reads_after_a_fix_and_as_a_dcf(
    readings: dict[str, reader.EdsParseResult],
) -> None:
    some = list(readings)[::4]  # canopen takes most of the time
    read = [name for name in some if accepted(writer.dumps(readings[name]))]
    assert len(read) >= len(some) // 2
    for name in read:
        assert accepted(writer.dumps(fix(readings[name]).reading)), name
        assert accepted(writer.dumps(dcf.make(readings[name], dcf.Settings(5)))), name
