"""The keys of ``[bus]`` and the PDO tables for SYNC, TIME and remote frames; each cell has just one defect."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.cell import reader
from kit import cells

SYNC = "sync = true\n"


def with_object(index: str, data_type: str, default: str):
    """Return a change of an EDS text that adds a VAR."""

    def change(text: str) -> str:
        return (
            text
            + f"[{index}]\nParameterName=Added {index}\nObjectType=0x7\nDataType={data_type}\nAccessType=rw\n"
            f"DefaultValue={default}\nPDOMapping=0\n"
        )

    return change


def bus(*lines: str) -> tuple[str, str]:
    return SYNC, SYNC + "".join(f"{line}\n" for line in lines)


def test_the_defaults_are_those_of_the_standard(tmp_path: Path) -> None:
    read = reader.load(cells.write(tmp_path)).bus
    assert (read.sync_cob_id, read.time_cob_id, read.sync_counter, read.sync_producer) == (
        0x80,
        0x100,
        0,
        "master",
    )
    assert (read.time, read.sync_timeout, read.hears_sync) == (None, None, False)


def test_all_keys_of_sync_and_time_are_read(tmp_path: Path) -> None:
    lines = (
        'sync_producer = "external"',
        "sync_cob_id = 0x90",
        "sync_counter = 240",
        'sync_timeout = "20ms"',
        'time = "1s"',
        "time_cob_id = 0x104",
    )
    read = reader.read(cells.write(tmp_path, bus(*lines)))[0]
    assert read is not None
    assert (read.bus.sync_cob_id, read.bus.sync_counter, read.bus.sync_timeout) == (0x90, 240, 0.02)
    assert (read.bus.time, read.bus.time_cob_id, read.bus.hears_sync) == (1.0, 0x104, True)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('sync_producer = "drive"', 'expected one of "master", "external"'),
        ("sync_cob_id = 0x800", "from 1 to 2047"),
        ("sync_counter = 1", "from 2 to 240"),
        ("sync_counter = 241", "from 2 to 240"),
        ("sync_timeout = 20", 'add the unit: "20ms"'),
        ("time = true", "a time with its unit"),
        ('time = "0s"', "a time with its unit"),
    ],
)
def test_an_invalid_value_is_one_error(tmp_path: Path, line: str, words: str) -> None:
    assert words in str(cells.only(cells.write(tmp_path, bus(line)), "error", line))


@pytest.mark.parametrize("cob_id", ["6E0", "105", "780"])
def test_sync_keeps_off_the_restricted_identifiers(tmp_path: Path, cob_id: str) -> None:
    line = f"sync_cob_id = 0x{cob_id}"
    problem = cells.only(cells.write(tmp_path, bus(line)), "error", line)
    assert f"sync_cob_id cannot be {cob_id}h" in problem.message
    assert "by default 080h" in problem.remedy


def test_sync_on_the_identifier_of_a_pdo_is_reported(tmp_path: Path) -> None:
    found = cells.serious(cells.write(tmp_path, bus("sync_cob_id = 0x181")))
    assert any(
        "181h is produced twice: SYNC of the master and TPDO1 of node 1" in str(each) for each in found
    )


def test_nodes_that_listen_elsewhere_are_set_at_boot(tmp_path: Path) -> None:
    path = cells.write(tmp_path, bus("sync_cob_id = 0x90"))
    assert cells.serious(path) == []
    told = [each for each in cells.notes(path) if "waits for SYNC on the COB-ID 080h" in each.message]
    assert len(told) == 2
    assert "the master sends 090h" in told[0].message
    assert told[0].remedy == "boot sets 1005h to 90h"


def test_a_counter_that_a_node_does_not_know_is_warned_of(tmp_path: Path) -> None:
    found = cells.serious(cells.write(tmp_path, bus("sync_counter = 10")))
    assert [each.severity.value for each in found] == ["warning", "warning"]
    assert "node 1 possibly does not accept a SYNC with a counter" in found[0].message
    known = with_object("1019", "0x0005", "0")
    assert cells.serious(cells.write(tmp_path, bus("sync_counter = 10"), eds=known)) == []


def test_words_without_effect_are_warned_of(tmp_path: Path) -> None:
    line = 'sync_timeout = "20ms"'
    assert "has no effect" in cells.only(cells.write(tmp_path, bus(line)), "warning", line).message


def test_two_producers_of_sync_are_one_too_many(tmp_path: Path) -> None:
    sends = (
        '[nodes.2]\neds = "drive.eds"\n',
        '[nodes.2]\neds = "drive.eds"\n[nodes.2.objects]\n"1005" = 0x40000080\n',
    )
    external = bus('sync_producer = "external"')
    one = cells.write(tmp_path, external, sends)
    assert cells.serious(one) == []
    both = cells.write(tmp_path, external, sends, ('"6065" = 4000', '"6065" = 4000\n"1005" = 0x40000080'))
    assert "nodes 1 and 2 both produce SYNC" in cells.only(both, "error", "[nodes.2]").message


PDO = "transmission = 1"


@pytest.mark.parametrize(
    ("lines", "severity", "marker", "words"),
    [
        ('transmission = 253\nrtr = "100ms"', None, "", ""),
        ('transmission = 252\nrtr = "100ms"', None, "", ""),
        ("transmission = 253", "error", "transmission = 253", "needs remote frames"),
        (
            'transmission = 1\nrtr = "100ms"',
            "error",
            "rtr =",
            "rtr requests a PDO that is sent without a request",
        ),
        ('transmission = 253\nrtr = "100"', "error", "rtr =", "cannot be used"),
    ],
)
def test_remote_frames_are_accepted_only_with_a_matching_transmission_type(
    tmp_path: Path, lines: str, severity: str | None, marker: str, words: str
) -> None:
    path = cells.write(tmp_path, (PDO, lines))
    if severity is None:
        assert cells.serious(path) == []
    else:
        assert words in cells.only(path, severity, marker).message


def test_type_252_is_sampled_at_sync_and_needs_it(tmp_path: Path) -> None:
    path = cells.write(
        tmp_path,
        ("sync = true", "sync = false"),
        (PDO, 'transmission = 252\nrtr = "100ms"'),
        ('\n[groups.xy]\naxes = ["x", "y"]', ""),
        ('modes = ["pp", "pv", "hm", "csp"]\n', ""),
    )
    assert "transmission = 253" in cells.only(path, "error", "transmission = 252").remedy


@pytest.mark.parametrize(
    ("counter", "start", "severity", "words"),
    [
        (10, 10, None, ""),
        (10, 11, "error", "sync_start = 11 is never reached"),
        (0, 3, "warning", "sync_start = 3 has no effect"),
    ],
)
def test_a_start_value_needs_a_counter_that_reaches_it(
    tmp_path: Path, counter: int, start: int, severity: str | None, words: str
) -> None:
    path = cells.write(
        tmp_path,
        *([bus(f"sync_counter = {counter}")] if counter else []),
        (PDO, f"transmission = 1\nsync_start = {start}"),
        eds=cells.both(with_object("1019", "0x0005", "0"), cells.with_sub("1801", 6, "0x0005", "rw", "0")),
    )
    if severity is None:
        assert cells.serious(path) == []
    else:
        assert words in cells.only(path, severity, f"sync_start = {start}").message


@pytest.mark.parametrize(
    ("period", "words"),
    [("4000", ""), ("2000", "node 2 sends SYNC every 2000 µs, but scan_period is 4000 µs")],
)
def test_the_producers_period_is_that_of_the_scan(tmp_path: Path, period: str, words: str) -> None:
    sends = (
        '[nodes.2]\neds = "drive.eds"\n',
        '[nodes.2]\neds = "drive.eds"\n[nodes.2.objects]\n"1005" = 0x40000080\n',
    )
    path = cells.write(
        tmp_path, bus('sync_producer = "external"'), sends, eds=with_object("1006", "0x0007", period)
    )
    if words:
        assert cells.only(path, "warning", "[nodes.2]").message == words
    else:
        assert cells.serious(path) == []


def test_requested_pdos_count_in_the_bus_load(tmp_path: Path) -> None:
    """Every 100 ms in cycles of 4 ms: 0.04 of a TPDO of 6 bytes and of a remote frame."""
    told = cells.note(cells.write(tmp_path, (PDO, 'transmission = 253\nrtr = "100ms"')), "the bus load is")
    assert "0.04 remote frame x 55" in told.observed


@pytest.mark.parametrize(("period", "warned"), [("5000", True), ("4000", False), ("0", False)])
def test_a_node_with_another_cycle_period_than_the_scan_is_a_warning(
    tmp_path: Path, period: str, warned: bool
) -> None:
    """1006h; Delta's ASDA-A2 reports a lost SYNC if it is not that of its master (github.com/gbcwbz/canfestival-rtt, issue 18)."""
    path = cells.write(tmp_path, eds=with_object("1006", "0x7", period))
    found = [each for each in cells.serious(path) if "another period" in each.message]
    assert [each.rule for each in found] == ["C126"] * (2 * warned)
    if warned:
        assert "(1006h) is 5000 µs, and SYNC comes every 4000 µs" in found[0].observed
        assert found[0].remedy == 'write "1006" = 4000 in [nodes.1.objects]'
