"""The bus: the load of a cycle, whether the period can be kept, and the detection of the loss of the master."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from axisbus.cell import reader
from axisbus.check.cycle_schedule import nearest_period, shortest, timetable
from axisbus.cia301.frame import worst_bits
from axisbus.core.files import load_dictionaries
from kit import cells

NO_GROUP = ('\n[groups.xy]\naxes = ["x", "y"]', "")
NO_MODES = ('modes = ["pp", "pv", "hm", "csp"]\n', "")


def stuffed_bits(data_bytes: int) -> int:
    """The longest frame with an 11-bit identifier, by the fields of ISO 11898-1."""
    stuffed = 1 + 11 + 1 + 1 + 1 + 4 + 8 * data_bytes + 15  # SOF, identifier, RTR, IDE, r0, DLC, data, CRC
    rest = 1 + 1 + 1 + 7 + 3  # CRC delimiter, ACK, ACK delimiter, EOF, intermission
    return stuffed + (stuffed - 1) // 4 + rest


def test_the_longest_frames_are_those_of_the_standard() -> None:
    assert [worst_bits(count) for count in (0, 1, 8)] == [55, 65, 135]
    assert [worst_bits(count) for count in range(9)] == [stuffed_bits(count) for count in range(9)]


def test_the_arithmetic_of_the_bus_load_is_shown(tmp_path: Path) -> None:
    # Node 1: its PDOs as they are (6 bytes, 6 bytes; 7 bytes, 6 bytes). Node 2: 6060h is in no PDO of its, so boot maps RPDO1 to
    # 6040, 6060, 607A (7 bytes) and RPDO2 to 60FF, 6071 (6 bytes). Three heartbeats in 100 ms, each 65 bits.
    told = cells.note(cells.write(tmp_path), "the bus load is")
    bits = 55 + 2 * 115 + 125 + 115 + 2 * (125 + 115) + 3 * 65 * 4 / 100
    assert told.message == f"the bus load is {bits / 4000:.0%} at worst"
    assert told.observed.endswith(f"= {bits:.0f} bits, of 1000 kbit/s x 4 ms = 4000 bits")
    assert "1 SYNC x 55" in told.observed
    assert "0.12 heartbeats x 65" in told.observed


@pytest.mark.parametrize(
    ("bitrate", "period", "severity", "load"),
    [
        # 1005 bits for PDOs and SYNC with everything at each SYNC; TPDO2 of node 2 (115) comes with one in three, one in nine
        ("500_000", "3ms", "warning", "62%"),  # 928, and 6 of heartbeats, in 1500
        ("250_000", "4ms", "error", "91%"),  # 903 and 8 in 1000
    ],
)
def test_a_bus_that_is_too_full_is_reported_with_the_period_that_would_fit(
    tmp_path: Path, bitrate: str, period: str, severity: str, load: str
) -> None:
    path = cells.write(tmp_path, ("bitrate = 1_000_000", f"bitrate = {bitrate}"), ('"4ms"', f'"{period}"'))
    problem = cells.only(path, severity, "scan_period")
    assert problem.message == f"the bus load is {load} at worst"
    assert "SYNC x 55" in problem.observed
    assert 'scan_period = "' in problem.remedy


def test_the_period_in_the_remedy_fits(tmp_path: Path) -> None:
    slow = ("bitrate = 1_000_000", "bitrate = 250_000")
    (problem,) = cells.serious(cells.write(tmp_path, slow))
    proposed = problem.remedy.split('"')[1]
    assert cells.serious(cells.write(tmp_path, slow, ('"4ms"', f'"{proposed}"'))) == []


def test_check_and_plan_report_the_same_shortest_period_and_the_same_load(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("bitrate = 1_000_000", "bitrate = 250_000"))
    (problem,) = cells.serious(path)
    cell = reader.load(path)
    files = load_dictionaries(cell)
    calm, least = (float(each) / 1000 for each in re.findall(r'"([\d.]+)ms"', problem.remedy))
    assert least == shortest(cell, files, 250_000)
    assert least < calm
    assert f"{timetable(cell, files, 250_000).load:.0%}" in problem.message


def test_frames_sent_more_than_once_in_a_cycle_count_as_often(tmp_path: Path) -> None:
    """Three heartbeats every 10 ms are six in a cycle of 20 ms, for ``check`` and for ``plan``."""
    path = cells.write(tmp_path, ('"4ms"', '"20ms"'), ('heartbeat = "100ms"', 'heartbeat = "20ms"'))
    once = timetable(reader.load(path), load_dictionaries(reader.load(path)), 1_000_000)
    bus = reader.load(path).bus
    cell = replace(reader.load(path), bus=replace(bus, heartbeat=0.01))  # not valid in a cell file
    twice = timetable(cell, load_dictionaries(cell), 1_000_000)
    assert twice.bits - once.bits == pytest.approx(3 * 65)
    assert twice.fullest - once.fullest == pytest.approx(3 * 65 / 1_000_000)


def test_event_driven_pdos_count_as_often_as_their_inhibit_time_permits(tmp_path: Path) -> None:
    # Without SYNC boot gives TPDOs an inhibit time of 5 ms where they have none: 0.8 in a cycle of 4 ms; one is set to 40 ms.
    path = cells.write(
        tmp_path,
        ("transmission = 1", 'transmission = 255\ninhibit_time = "40ms"'),
        ("sync = true", "sync = false"),
        NO_GROUP,
        NO_MODES,
    )
    bits = 3 * 115 + 125 + 0.8 * (125 + 125 + 115) + 0.1 * 115 + 3 * 65 * 4 / 100
    assert f"= {bits:.0f} bits" in cells.note(path, "the bus load is").observed


def test_a_tpdo_with_every_fourth_sync_counts_a_quarter(tmp_path: Path) -> None:
    # Planned again for every SYNC where it carries a value of motion's; a PDO of something else keeps its own rate.
    other = ('map = ["606C", "6077:00"]\ntransmission = 1', 'map = ["603F"]\ntransmission = 4')
    told = cells.note(cells.write(tmp_path, other), "the bus load is")
    assert "0.25 TPDO x 75" in told.observed


def test_an_unknown_bitrate_is_noted(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("bitrate = 1_000_000\n", ""))
    assert cells.serious(path) == []
    assert cells.note(path, "the bus load cannot be computed").line == cells.line_of(path, "[bus]")


def test_the_simulation_needs_no_bitrate(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("bitrate = 1_000_000\n", ""), ('"pcan"', '"sim"'))
    assert not [each for each in cells.notes(path) if "bus load" in each.message]


# -- the period ------------------------------------------------------------------------------------------------------


def test_a_period_that_60c2_cannot_hold_is_reported_with_the_nearest(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('"4ms"', '"3.333ms"'))
    problem = cells.only(path, "warning", '"3.333ms"')
    assert "cyclic modes will be refused on x, y" in problem.message
    assert 'scan_period = "3.3ms"' in problem.remedy


@pytest.mark.parametrize(
    ("period", "nearest"), [(0.004, 0.004), (0.003333, 0.0033), (0.000255, 0.000255), (0.2587, 0.26)]
)
def test_the_nearest_period_is_1_to_255_times_a_power_of_ten(period: float, nearest: float) -> None:
    assert nearest_period(period) == pytest.approx(nearest)


def test_any_period_serves_without_cyclic_modes(tmp_path: Path) -> None:
    assert cells.serious(cells.write(tmp_path, ('"4ms"', '"3.333ms"'), NO_GROUP, NO_MODES)) == []


def test_a_very_short_period_is_only_warned_of(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('"4ms"', '"900us"'), ("bitrate = 1_000_000\n", ""))
    problem = cells.only(path, "warning", '"900us"')
    assert "a scan_period of 0.9 ms is shorter than an ordinary computer can keep" in problem.message


# -- detection of the loss of the master --------------------------------------------------------------------------------------


def test_a_drive_that_cannot_notice_a_dead_master_is_warned_of(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.without("1016"))
    found = cells.serious(path)
    assert [each.severity.value for each in found] == ["warning", "warning"]
    assert [each.line for each in found] == [
        cells.line_of(path, "[nodes.1]"),
        cells.line_of(path, "[nodes.2]"),
    ]
    assert "node 1: nothing on this drive detects the loss of the master" in found[0].message
    assert "neither 1016h" in found[0].observed


def test_node_guarding_is_a_watchdog_too(tmp_path: Path) -> None:
    guarding = "".join(
        f"[{index}]\nParameterName={name}\nDataType={kind}\nAccessType=rw\nDefaultValue=0\nPDOMapping=0\n"
        for index, name, kind in (("100C", "Guard time", "0x6"), ("100D", "Life time factor", "0x5"))
    )
    path = cells.write(tmp_path, eds=cells.both(cells.without("1016"), lambda text: text + guarding))
    assert cells.serious(path) == []


def test_a_drive_whose_reaction_is_unknown_is_noted(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.without("6007"))
    assert cells.serious(path) == []
    told = cells.note(path, "axis x: the reaction of the drive to the loss of the master is unknown")
    assert "has 1016h (consumer heartbeat) but no 6007h" in told.observed
    assert "low speed" in told.remedy


def test_a_heartbeat_that_is_off_is_warned_of(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ('heartbeat = "100ms"', 'heartbeat = "off"'))
    assert (
        "no drive can use it to detect the loss of the master" in cells.only(path, "warning", '"off"').message
    )


@pytest.mark.parametrize(
    ("written", "words", "remedy"),
    [
        ("2.5ms", "cannot be set in the drives", '"4ms"'),
        ("3ms", "faster than the scan that sends it", '"100ms"'),
        ("19.9999s", "cannot be set in the drives", '"20000ms"'),
    ],
)
def test_an_invalid_heartbeat_period_is_refused(
    tmp_path: Path, written: str, words: str, remedy: str
) -> None:
    path = cells.write(tmp_path, ('heartbeat = "100ms"', f'heartbeat = "{written}"'))
    problem = cells.only(path, "error", f'"{written}"')
    assert words in problem.message
    assert remedy in problem.remedy


def test_a_node_without_heartbeat_is_noted(tmp_path: Path) -> None:
    path = cells.write(tmp_path, eds=cells.without("1017"))
    assert cells.serious(path) == []
    assert "lacks 1017h" in cells.note(path, "node 1 sends no heartbeat").observed
