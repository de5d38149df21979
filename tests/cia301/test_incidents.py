"""Emergency messages grouped into incidents, the error field 1003h, and TIME_OF_DAY: numbers worked by hand."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.cia301 import emcy as errorfield
from axisbus.cia301.emcy import Emcy, parse
from axisbus.cia301.incident import HISTORY, MESSAGES, Incident, Incidents, IncidentState, group
from axisbus.cia301.timeofday import TimeOfDay
from axisbus.cia301.timeofday import parse as parse_time
from axisbus.errors import ArgumentError


def told(*messages: tuple[float, str]) -> tuple[Incident, ...]:
    """Incidents of frames as (time, hexadecimal data)."""
    return group(parse(bytes.fromhex(data), stamp) for stamp, data in messages)


OVERCURRENT = "10 23 03 00 00 00 00 00"  # 2310h, generic and current
UNDERVOLTAGE = "20 32 07 00 00 00 00 00"  # 3220h, voltage too
HEARTBEAT = "30 81 11 00 00 00 00 00"  # 8130h, communication
ALL_GONE = "00 00 00 00 00 00 00 00"
ONE_GONE = "00 00 05 00 00 00 00 00"  # the voltage is still wrong


def test_a_fault_and_its_reset_are_one_incident_that_recovered() -> None:
    (incident,) = told((1.0, OVERCURRENT), (6.5, ALL_GONE))
    assert incident.outcome is IncidentState.RECOVERED
    assert incident.codes == (0x2310,)
    assert incident.lasted == pytest.approx(5.5)
    assert [reset.code for reset in incident.resets] == [0]


@pytest.mark.parametrize(
    ("second", "codes"),
    [
        (1.05, [(0x2310, 0x3220)]),
        (1.0999, [(0x2310, 0x3220)]),
        (1.15, [(0x2310,), (0x3220,)]),
    ],
)
def test_emergencies_within_a_tenth_of_a_second_belong_to_the_fault(
    second: float, codes: list[tuple[int, ...]]
) -> None:
    incidents = told((1.0, OVERCURRENT), (second, UNDERVOLTAGE))
    assert [incident.codes for incident in incidents] == codes
    assert {incident.outcome for incident in incidents} == {IncidentState.UNRESOLVED}


def test_a_reset_that_leaves_bits_in_the_register_resolves_nothing() -> None:
    incidents = told((1.0, OVERCURRENT), (1.01, UNDERVOLTAGE), (2.0, ONE_GONE))
    (incident,) = incidents
    assert incident.outcome is IncidentState.UNRESOLVED
    assert len(incident.resets) == 1
    (incident,) = told((1.0, OVERCURRENT), (1.01, UNDERVOLTAGE), (2.0, ONE_GONE), (3.0, ALL_GONE))
    assert incident.outcome is IncidentState.RECOVERED
    assert incident.lasted == pytest.approx(2.0)
    assert len(incident.resets) == 2


def test_a_reset_resolves_every_incident_that_is_open() -> None:
    first, second, third = told((1.0, HEARTBEAT), (5.0, OVERCURRENT), (9.0, ALL_GONE), (9.01, UNDERVOLTAGE))
    assert [each.ended for each in (first, second, third)] == [9.0, 9.0, None]
    assert [each.number for each in (first, second, third)] == [1, 2, 3]


def test_a_reset_that_no_fault_preceded_is_no_incident() -> None:
    assert told((1.0, ALL_GONE)) == ()


def test_a_short_reset_counts_as_one() -> None:
    """Two bytes, as some drives send: the register that is not there is read as 0."""
    (incident,) = told((1.0, "11 86"), (2.0, "00 00"))
    assert incident.codes == (0x8611,)
    assert incident.outcome is IncidentState.RECOVERED


def test_a_restart_of_the_node_ends_the_open_incident() -> None:
    incidents = Incidents()
    incidents.note(parse(bytes.fromhex(OVERCURRENT), 1.0))
    incidents.booted(4.0)
    (incident,) = incidents
    assert (incident.outcome, incident.rebooted, incident.lasted) == (IncidentState.RECOVERED, True, 3.0)
    assert incidents.open == ()


def test_the_incidents_of_a_drive_that_sends_a_thousand_emergencies_are_bounded() -> None:
    incidents = Incidents()
    for number in range(1000):
        incidents.note(Emcy(0x2310, 1, bytes(5), number * 0.0001))
    (one,) = incidents
    assert len(one.emcys) == MESSAGES
    assert one.more == 1000 - MESSAGES
    for number in range(1000):
        incidents.note(Emcy(0x2310, 1, bytes(5), 1.0 + number))
    assert len(incidents) == HISTORY
    assert [incident.number for incident in incidents] == list(range(1001 - HISTORY + 1, 1002))
    incidents.note(Emcy(0, 0, bytes(5), 2000.0))
    assert incidents.open == ()


def test_a_crowded_incident_recovers_too() -> None:
    messages = [Emcy(0x2310, 1, bytes(5), 1.0)] * 50
    (incident,) = group([*messages, Emcy(0, 0, bytes(5), 2.0)])
    assert incident.ended == 2.0


@given(
    st.lists(
        st.tuples(st.floats(0.0, 0.3), st.sampled_from([0, 0x2310, 0x8130]), st.sampled_from([0, 1, 0x11]))
    )
)
def test_no_message_is_lost_or_reported_twice(steps: list[tuple[float, int, int]]) -> None:
    now, messages = 0.0, []
    for step, code, register in steps[:20]:
        now += step
        messages.append(Emcy(code, register, bytes(5), now))
    incidents = group(messages)
    faults = [emcy for incident in incidents for emcy in incident.emcys]
    assert faults == [emcy for emcy in messages if not emcy.is_reset]
    assert all(emcy.stamp - each.began <= 0.1 for each in incidents for emcy in each.emcys)
    last = messages[-1] if messages else None
    if last is not None and last.is_reset and last.register == 0:
        assert all(incident.outcome is IncidentState.RECOVERED for incident in incidents)


# -- 1003h


def field(*values: int, count: int | None = None) -> dict[tuple[int, int], int]:
    entries = {(0x1003, number): value for number, value in enumerate(values, start=1)}
    return {(0x1003, 0): len(values) if count is None else count, **entries}


def test_the_error_field_is_read_newest_first() -> None:
    objects = field(0x0000_8611, 0x1234_2310)
    entries = errorfield.read(lambda index, subindex: objects.get((index, subindex)))
    assert entries == ((1, 0x8611, 0), (2, 0x2310, 0x1234))
    assert str(entries[1]).startswith("2. 0x2310, ")
    assert str(entries[1]).endswith("additional information 0x1234")
    assert "additional" not in str(entries[0])


@pytest.mark.parametrize(
    ("objects", "expected"),
    [
        ({}, None),  # no 1003h
        (field(), ()),
        (field(0x8130, count=5), ((1, 0x8130, 0),)),  # a count that promises more than there is
        (field(0x8130, count=255), ((1, 0x8130, 0),)),
    ],
)
def test_an_error_field_that_is_empty_or_lies(objects: dict[tuple[int, int], int], expected: object) -> None:
    assert errorfield.read(lambda index, subindex: objects.get((index, subindex))) == expected


# -- TIME_OF_DAY. 1 January 2000 is day 5844 after 1 January 1984 (16 years with leap days in 84, 88, 92, 96).

TIMES = [
    (datetime(1984, 1, 1, tzinfo=UTC), "00 00 00 00 00 00"),
    (datetime(1984, 1, 2, 0, 0, 1, tzinfo=UTC), "e8 03 00 00 01 00"),
    (datetime(2000, 1, 1, tzinfo=UTC), "00 00 00 00 d4 16"),
    (datetime(2000, 1, 1, 23, 59, 59, 999_000, tzinfo=UTC), "ff 5b 26 05 d4 16"),
    (datetime(2163, 6, 6, 12, tzinfo=UTC), "00 2e 93 02 ff ff"),
]


@pytest.mark.parametrize(("moment", "frame"), TIMES)
def test_time_of_day_is_encoded_and_decoded(moment: datetime, frame: str) -> None:
    assert TimeOfDay.of(moment).encode() == bytes.fromhex(frame)
    read = parse_time(bytes.fromhex(frame))
    assert read is not None
    assert read.moment == moment


def test_a_time_of_another_zone_is_sent_as_utc() -> None:
    there = datetime(2000, 1, 1, 1, 0, tzinfo=timezone(timedelta(hours=2)))
    assert TimeOfDay.of(there) == (82_800_000, 5843)


@pytest.mark.parametrize(
    "moment",
    [datetime(2000, 1, 1), datetime(1983, 12, 31, tzinfo=UTC), datetime(2163, 6, 7, tzinfo=UTC)],
)
def test_a_moment_that_cannot_be_sent_as_time_is_an_argument_error(moment: datetime) -> None:
    with pytest.raises(ArgumentError):
        TimeOfDay.of(moment)


def test_the_four_void_bits_count_for_nothing() -> None:
    assert parse_time(bytes.fromhex("e8 03 00 f0 01 00")) == (1000, 1)


@pytest.mark.parametrize("frame", ["", "00 00 00 00 01", "00 5c 26 05 01 00"])
def test_a_time_that_is_too_short_or_past_midnight_is_ignored(frame: str) -> None:
    assert parse_time(bytes.fromhex(frame)) is None
