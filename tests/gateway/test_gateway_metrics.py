"""The figures of a machine for Prometheus: of now or not there, and counted once; read by Prometheus's own parser."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("prometheus_client", reason="metrics need prometheus-client")

from prometheus_client.parser import text_string_to_metric_families

from axisbus.bus.link.ownership import command_of, described
from axisbus.errors import SdoAbort, StateError
from axisbus.gateway import metrics_server as server
from axisbus.gateway.metrics_exporter import Exporter, Growth, MetricCounters
from axisbus.gateway.metrics_server import MetricsServer
from axisbus.machine.machine import Machine
from axisbus.session import LATENESS_BOUNDS
from kit import command_line
from kit.cell import Cell
from kit.closed_connection import closed
from kit.connection_flood import Crowd
from kit.scenarios.core_process import OWN_PROCESS, own_cell

DASHBOARD = Path(__file__).parents[2] / "examples" / "dashboard.json"


def read(url):
    """All samples that are served: value by name and labels."""
    with urllib.request.urlopen(url, timeout=10) as answer:
        text = answer.read().decode()
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def found(samples, name, **labels):
    """Values of a name whose labels hold these."""
    wanted = set(labels.items())
    return [value for (each, have), value in samples.items() if each == name and wanted <= have]


@pytest.fixture
def exporter():
    return Exporter()


@pytest.fixture
def url(exporter):
    server = MetricsServer(exporter, "127.0.0.1", 0)
    yield server.url
    server.close()


def test_without_a_machine_only_axisbus_up_is_served(url):
    samples = read(url)
    assert found(samples, "axisbus_up") == [0.0]
    assert {name for name, _ in samples} == {"axisbus_up"}


def test_values_of_a_machine_are_served_in_their_units(exporter, url, machine):
    exporter.machine = machine
    machine["x"].enable().wait(5)
    machine["x"].move_absolute(5.0).wait(20)
    exporter.poll()
    samples = read(url)
    assert found(samples, "axisbus_up") == [1.0]
    assert found(samples, "axisbus_axis_position", axis="x", unit=machine["x"].unit) == [
        pytest.approx(machine["x"].position)
    ]
    assert found(samples, "axisbus_axis_state", axis="x", state="Standstill") == [1.0]
    assert found(samples, "axisbus_axis_state", axis="y", state="Disabled") == [1.0]
    assert found(samples, "axisbus_axis_error", axis="x") == [0.0]
    assert found(samples, "axisbus_node_nmt_state", node="1", state="operational") == [1.0]
    assert found(samples, "axisbus_node_booted", node="1") == [1.0]
    assert found(samples, "axisbus_cycles_total") == [float(machine.cycle_jitter.cycles)]


def test_late_cycles_are_in_their_buckets_of_the_histogram(exporter, url, machine):
    exporter.machine = machine
    faults = Cell(machine).faults
    machine.sleep(0.5)
    for _ in range(3):
        faults.send_blocks = 0.05
        machine.sleep(0.2)
    samples, report = read(url), machine.cycle_jitter
    name = "axisbus_cycle_lateness_seconds"
    bounds = sorted(
        (float(dict(labels)["le"]), count)
        for (each, labels), count in samples.items()
        if each == f"{name}_bucket"
    )
    assert [bound for bound, _ in bounds] == list(LATENESS_BOUNDS)
    counts = [count for _, count in bounds]
    assert counts == sorted(counts) == list(report.within)
    assert found(samples, f"{name}_count") == [counts[-1]] == [float(report.cycles)]
    assert found(samples, f"{name}_sum") == [report.total]
    late = found(samples, f"{name}_count")[0] - found(samples, f"{name}_bucket", le="0.03125")[0]
    assert late == 3
    assert found(samples, "axisbus_cycle_lateness_worst_seconds") == [report.worst]
    assert 0.03125 < report.worst < 0.25


def test_a_fault_is_served_and_its_message_counted_once(exporter, url, machine):
    exporter.machine = machine
    machine["x"].enable().wait(5)
    machine.simulated_node(1).fault(0x8611)
    machine.sleep(1.0)
    for _ in range(3):
        exporter.poll()
    samples = read(url)
    assert found(samples, "axisbus_axis_error", axis="x") == [1.0]
    assert found(samples, "axisbus_emcy_total", node="1", code="8611") == [1.0]


def test_values_that_are_not_current_are_left_out(exporter, url, machine):
    exporter.machine = machine
    assert found(read(url), "axisbus_axis_position", axis="x")
    machine.close()
    samples = read(url)
    assert found(samples, "axisbus_up") == [0.0]
    assert not found(samples, "axisbus_axis_position")


def test_counters_count_new_events_and_lose_none():
    tally = MetricCounters()

    def items(*stamps):
        return [(SimpleNamespace(stamp=stamp), ("1", "8611"), 2) for stamp in stamps]

    tally.take(1, items(1.0, 2.0))
    tally.take(1, items(1.0, 2.0, 3.0))
    tally.take(2, items(1.0))
    tally.take(1, items())
    assert tally.counts == {("1", "8611"): 8}


def test_growth_is_counted_by_name_also_after_a_source_has_left():
    growth = Growth()
    growth.take([("a 1", "a", 0), ("b 1", "b", 5)])
    growth.take([("a 1", "a", 3), ("a 2", "a", 2), ("b 1", "b", 5)])
    growth.take([("a 2", "a", 2)])
    growth.take([("a 2", "a", 4), ("b 2", "b", 1)])
    assert growth.counts == {("a",): 7, ("b",): 6}
    growth.take([("b 2", "b", 0)])  # restarts under the same name
    growth.take([("b 2", "b", 2)])
    assert growth.counts["b",] == 8


def test_two_connections_of_one_program_are_one():
    growth = Growth()
    for _ in range(3):
        growth.take([("a 1", "a", 10), ("a 1", "a", 0)])
    assert growth.counts == {("a",): 10}


def test_names_without_end_are_not_all_kept():
    growth = Growth()
    for number in range(100):
        growth.take([(f"{number}", f"job {number}", 1)])
    assert len(growth.counts) == 33
    assert growth.counts["others",] == 100 - 32
    growth.take([("again", "job 0", 1)])
    assert growth.counts["job 0",] == 2


def test_the_name_of_a_program_is_its_command_without_process_id_and_time():
    name = command_of(described(os.getpid(), kept=True))
    assert name
    assert str(os.getpid()) not in name
    assert name == command_of(described(os.getpid(), kept=True).replace(str(os.getpid()), "1"))
    assert command_of(
        "process 7 (/usr/bin/python3 /home/a b/job.py --fast (x)), which began at 12:00:01"
    ) == ("python3 a job.py --fast (x)")
    assert command_of(described(2**22 + 1, kept=True)) == "ended"


def test_a_port_in_use_is_reported(exporter, url):
    with pytest.raises(StateError, match="cannot be served") as caught:
        MetricsServer(exporter, "127.0.0.1", int(re.search(r":(\d+)/", url)[1]))
    assert "in use" in caught.value.observed


def place_of(url):
    return "127.0.0.1", int(re.search(r":(\d+)/", url)[1])


def threads():
    return sum(each.name.startswith("Thread-") for each in threading.enumerate())


def test_silent_connections_exclude_no_client_and_use_few_threads(url):
    before = threads()
    with ExitStack() as stack:
        lines = [
            stack.enter_context(socket.create_connection(place_of(url), timeout=5.0))
            for _ in range(server.CONNECTIONS + 10)
        ]
        assert closed(lines[0], 5.0)
        assert found(read(url), "axisbus_up") == [0.0]
        assert threads() - before <= server.CONNECTIONS + 10  # those that end are ending
        until(lambda: threads() - before <= server.CONNECTIONS)


# The bytes that each of a thousand hostile connections sends, and whether it sends them repeatedly.
CROWDS = {
    "silent": (b"", False),
    "half a request": (b"GET /metrics HTTP/1.1\r\nHost: ", False),
    "a flood of requests": (b"GET /metrics HTTP/1.1\r\n\r\n", True),
    "a flood of junk": (b"x" * 4096, True),
}


@pytest.mark.parametrize("crowd", list(CROWDS))
def test_a_thousand_hostile_connections_prevent_no_read(url, crowd):
    said, flood = CROWDS[crowd]
    before = threads()
    with Crowd(place_of(url), said, flood=flood):
        for _ in range(3):
            began = time.monotonic()
            assert found(read(url), "axisbus_up") == [0.0]
            assert time.monotonic() - began < 8.0  # a Prometheus server gives up after 10
    until(lambda: threads() - before <= server.CONNECTIONS)


def test_a_client_that_takes_too_long_is_disconnected(url, monkeypatch):
    monkeypatch.setattr(server, "CONNECTION_TIMEOUT", 0.3)
    with socket.create_connection(place_of(url), timeout=5.0) as line:
        line.sendall(b"GET /metrics HTTP/1.1\r\nHost: ")
        assert closed(line, 5.0)
    assert found(read(url), "axisbus_up") == [0.0]


def test_label_values_with_any_content_are_unchanged(exporter, url):
    names = ['a "b"\\c\nü☃ {}=,', "x\\n", "\r\n# HELP x", "\u2028"]
    exporter._cycles.take((name, name, 1) for name in names)
    samples = read(url)
    for name in names:
        assert found(samples, "axisbus_lost_cycles_total", program=name) == [1.0]


def test_an_ipv6_address_is_in_brackets(exporter):
    if not socket.has_ipv6:
        pytest.skip("no IPv6 here")
    try:
        found_at = MetricsServer(exporter, "::1", 0)
    except StateError:
        pytest.skip("no IPv6 here")
    try:
        assert found_at.url.startswith("http://[::1]:")
        assert found(read(found_at.url), "axisbus_up") == [0.0]
    finally:
        found_at.close()


def test_each_query_of_the_dashboard_names_served_metrics(exporter, url, machine):
    exporter.machine = machine
    machine["x"].enable().wait(5)
    machine.simulated_node(1).fault(0x8611)
    machine.sleep(1.0)
    exporter.poll()
    with urllib.request.urlopen(url, timeout=10) as answer:
        families = list(text_string_to_metric_families(answer.read().decode()))
    served = {sample.name for family in families for sample in family.samples}
    typed = {f"{family.name}_total" for family in families if family.type == "counter"}
    queries = [
        target["expr"]
        for panel in json.loads(DASHBOARD.read_text("utf-8"))["panels"]
        for target in panel["targets"]
    ]
    asked = {name for query in queries for name in re.findall(r"axisbus_\w+", query)}
    for name, within in (("emcy", "1h"), ("node_events", "1h"), ("skipped_cycles", "5m")):
        each = f"axisbus_{name}_total"  # not there before the first one
        (query,) = (query for query in queries if each in query)
        assert f"({each} unless {each} offset {within}) or increase({each}[{within}])" in query
    assert asked - {"axisbus_bus_frames_total"} <= served | typed  # it has no bus: see below
    assert "axisbus_bus_frames_total" in asked


# -- a program of its own -------------------------------------------------------------------------------------------


def until(seen, within=20.0):
    end = time.monotonic() + within
    while not seen():
        assert time.monotonic() < end
        time.sleep(0.05)


@OWN_PROCESS
@pytest.mark.timeout(120)
def test_a_client_serves_the_counts_of_the_core(exporter, url, tmp_path, core_in_threads):
    with Machine.open(own_cell(tmp_path)) as machine, Machine.attach(machine.cell.file) as guest:
        exporter.machine = guest
        exporter.poll()
        before = read(url)
        dials = machine.simulated_node(1).device.dials
        dials.sdo_frames = 0
        dials.sdo_lost = {2}  # the answer
        assert machine.node(1).sdo[0x1000]
        dials.sdo_aborts = {(0x1008, 0): 0x0800_0000}
        with pytest.raises(SdoAbort):
            guest.node(1).sdo[0x1008]
        exporter.poll()
        after = read(url)

        def grown(name, **labels):
            return found(after, name, **labels)[0] - found(before, name, **labels)[0]

        assert found(before, "axisbus_sdo_transfers_total", node="1", end="done")[0] > 10  # boot-up
        assert grown("axisbus_sdo_retries_total", node="1") == 1.0
        assert grown("axisbus_sdo_transfers_total", node="1", end="done") == 1.0
        assert grown("axisbus_sdo_transfers_total", node="1", end="aborted") == 1.0
        assert grown("axisbus_sdo_retries_total", node="2") == 0.0
        assert found(after, "axisbus_node_boot_retries", node="1") == [0.0]
        name = command_of(guest.programs[0].who)
        assert found(after, "axisbus_lost_cycles_total", program=name) == [0.0]
        assert found(after, "axisbus_lost_frames_total", program=name) == [0.0]
        count = found(after, "axisbus_cycle_lateness_seconds_count")[0]
        assert count == found(after, "axisbus_cycle_lateness_seconds_bucket", le="+Inf")[0]
        assert found(after, "axisbus_cycles_total")[0] == pytest.approx(count, abs=2)
        assert found(after, "axisbus_cycle_lateness_seconds_sum")[0] > 0.0


@OWN_PROCESS
@pytest.mark.timeout(120)
def test_the_bridge_follows_one_machine_after_the_other_and_changes_none(tmp_path):
    file = own_cell(tmp_path)
    command = [sys.executable, "-u", "-m", "axisbus", "bridge", "metrics", str(file), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as bridge:
        url = bridge.stdout.readline().split()[-1]
        assert found(read(url), "axisbus_up") == [0.0]
        for _ in range(2):
            with Machine.open(file) as machine:
                machine["x"].enable().wait(20)
                until(lambda: found(read(url), "axisbus_axis_state", axis="x", state="Standstill") == [1.0])
                assert found(read(url), "axisbus_bus_frames_total")[0] > 100
            until(lambda: found(read(url), "axisbus_up") == [0.0])
        with Machine.open(file) as machine:
            until(lambda: found(read(url), "axisbus_up") == [1.0])
            machine["x"].enable().wait(20)
            handle = machine["x"].move_relative(20.0)
            bridge.send_signal(signal.SIGKILL)
            handle.wait(20)


def test_a_missing_cell_file_is_reported(monkeypatch, capsys, tmp_path):
    code, _, err = command_line.runner(monkeypatch, capsys)("bridge", "metrics", tmp_path / "none.toml")
    assert (code, "none.toml" in err) == (1, True)
