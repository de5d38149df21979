"""The figures of a machine for Prometheus: of now or not there, and counted once; read by Prometheus's own parser."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("prometheus_client", reason="metrics need prometheus-client")

from prometheus_client.parser import text_string_to_metric_families

from axisbus.errors import StateError
from axisbus.gateway.metrics.exporter import Exporter
from axisbus.gateway.metrics.server import MetricsServer
from axisbus.gateway.metrics.tallies import Tally
from axisbus.machine.machine import Machine
from kit import commands
from kit.cell import cell_text
from kit.stories.own import own_cell

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


@pytest.fixture
def machine(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(cell_text("xy"), "utf-8")
    with Machine.simulated(file) as opened:
        yield opened


def test_without_a_machine_it_is_down_and_nothing_else_is_told(url):
    samples = read(url)
    assert found(samples, "axisbus_up") == [0.0]
    assert {name for name, _ in samples} == {"axisbus_up"}


def test_what_a_machine_has_is_told_in_its_units(exporter, url, machine):
    exporter.machine = machine
    machine["x"].enable().wait(5)
    machine["x"].move_absolute(5.0).wait(20)
    exporter.look()
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
    assert found(samples, "axisbus_cycles_total") == [float(machine.lateness.cycles)]


def test_a_fault_is_told_and_its_message_counted_once(exporter, url, machine):
    exporter.machine = machine
    machine["x"].enable().wait(5)
    machine.stand_in(1).fault(0x8611)
    machine.sleep(1.0)
    for _ in range(3):
        exporter.look()
    samples = read(url)
    assert found(samples, "axisbus_axis_error", axis="x") == [1.0]
    assert found(samples, "axisbus_emcy_total", node="1", code="8611") == [1.0]


def test_what_is_not_of_now_is_left_out(exporter, url, machine):
    exporter.machine = machine
    assert found(read(url), "axisbus_axis_position", axis="x")
    machine.close()
    samples = read(url)
    assert found(samples, "axisbus_up") == [0.0]
    assert not found(samples, "axisbus_axis_position")


def test_a_tally_counts_what_is_new_and_forgets_nothing():
    tally = Tally()

    def items(*stamps):
        return [(SimpleNamespace(stamp=stamp), ("1", "8611"), 2) for stamp in stamps]

    tally.take(1, items(1.0, 2.0))
    tally.take(1, items(1.0, 2.0, 3.0))
    tally.take(2, items(1.0))
    tally.take(1, items())
    assert tally.counts == {("1", "8611"): 8}


def test_a_port_that_is_taken_is_told(exporter, url):
    with pytest.raises(StateError, match="cannot be served") as caught:
        MetricsServer(exporter, "127.0.0.1", int(re.search(r":(\d+)/", url)[1]))
    assert "in use" in caught.value.observed


def test_each_query_of_the_dashboard_is_of_what_is_served(exporter, url, machine):
    exporter.machine = machine
    machine["x"].enable().wait(5)
    machine.stand_in(1).fault(0x8611)
    machine.sleep(1.0)
    exporter.look()
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
    assert asked - {"axisbus_bus_frames_total"} <= served | typed  # it has no bus: see below
    assert "axisbus_bus_frames_total" in asked


# -- a program of its own -------------------------------------------------------------------------------------------


def until(seen, within=20.0):
    end = time.monotonic() + within
    while not seen():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.skipif(sys.platform != "linux", reason="a core in a process of its own is for Linux")
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


def test_what_is_no_cell_is_told(monkeypatch, capsys, tmp_path):
    code, _, err = commands.runner(monkeypatch, capsys)("bridge", "metrics", tmp_path / "none.toml")
    assert (code, "none.toml" in err) == (1, True)
