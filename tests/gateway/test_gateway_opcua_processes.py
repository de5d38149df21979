"""The OPC UA bridge as a program, a client of another stack, and a crowd that fills the queue of the kernel."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip("asyncua", reason="OPC UA needs asyncua")


from axisbus.gateway.opcua import limits
from axisbus.machine.machine import Machine
from kit import command_line
from kit.closed_connection import closed
from kit.opcua.client import visit
from kit.opcua.server import (
    ANNA,
    POSITION,
    X,
    connections,
    crowd_of,
    entered_again,
    good,
    halt,
    refused,
    running,
    until,
)
from kit.scenarios.core_process import OWN_PROCESS, own_cell, under_way

CLIENT = Path(__file__).parents[1] / "kit" / "opcua" / "client.js"


@pytest.fixture
def machine(file, server):
    with Machine.simulated(file) as opened:
        server.follow(opened)
        yield opened
        server.follow(None)


@pytest.mark.skipif(sys.platform != "linux", reason="a computer has more than one loopback address on Linux")
@pytest.mark.parametrize("from_address", ["127.0.0.1", "127.0.0.2"])
def test_a_thousand_silent_connections_prevent_no_halt(server, machine, from_address):
    with crowd_of(server, *[from_address] * 1000):
        assert visit(server.url, halt, ANNA) is not None
    until(lambda: entered_again(server))


@pytest.mark.skipif(sys.platform != "linux", reason="a computer has more than one loopback address on Linux")
def test_one_address_cannot_hold_all_connections_and_silent_ones_are_closed_first(server):
    others = [f"127.0.0.{number % 4 + 2}" for number in range(limits.CONNECTIONS + 8)]
    with crowd_of(server, *["127.0.0.2"] * (limits.OF_ADDRESS.connections + 3)) as lines:
        assert closed(lines[0], 3.0)  # the oldest
        until(lambda: len(connections(server)) == limits.OF_ADDRESS.connections)
        assert visit(server.url, running)[1] == "Good"
    with crowd_of(server, *others) as lines:
        assert closed(lines[0], 3.0)
        assert visit(server.url, running)[1] == "Good"
        assert len(connections(server)) <= limits.CONNECTIONS
    until(lambda: entered_again(server))


@contextmanager
def bridge(file, *words):
    """The command in a process of its own; yields the process and its address."""
    with command_line.started("bridge", "opcua", file, "--port", "0", *words, stderr=None) as process:
        try:
            yield process, process.stdout.readline().split()[-1]
        finally:
            process.kill()


@OWN_PROCESS
@pytest.mark.timeout(120)
def test_the_bridge_follows_machines_halts_them_and_its_end_changes_none(tmp_path, folder, known):
    file = own_cell(tmp_path)
    with bridge(file, "--users", folder / "users", "--allow-reset") as (process, url):

        def position():
            return visit(url, lambda seen: seen.value(POSITION))  # of the bridge that is there

        assert position() == (None, "BadWaitingForInitialData")
        with Machine.open(file) as machine:
            until(lambda: position()[1] == "Good")
            machine["x"].enable().wait(20)
            handle = under_way(machine["x"])
            first = position()[0]
            until(lambda: position()[0] != first)
            text = visit(url, halt, ANNA)
            assert text.startswith("x: Standstill at")
            assert handle.exception() is not None
            assert "x.halt() by process" in str(handle.exception())
            with refused("BadUserAccessDenied"):  # this program has control
                visit(url, lambda seen: seen.call(X, "Reset"), ANNA)
        until(lambda: position() == (None, "BadNoCommunication"))
        with Machine.open(file, shared=True):
            until(lambda: position()[1] == "Good")
            assert "Disabled" in visit(url, lambda seen: seen.call("", "Reset"), ANNA)
        until(lambda: position() == (None, "BadNoCommunication"))
        with Machine.open(file) as machine:
            until(lambda: position()[1] == "Good")
            machine["x"].enable().wait(20)
            handle = machine["x"].move_relative(20.0)
            process.send_signal(signal.SIGKILL)
            handle.wait(20)
            with bridge(file) as (another, url):
                until(lambda: position()[1] == "Good")
                another.send_signal(signal.SIGTERM)
                assert another.wait(10) == 143


def has_node_opcua():
    node = shutil.which("node")
    asked = [node, "-e", "require.resolve('node-opcua-client')"]
    return node is not None and subprocess.run(asked, capture_output=True, check=False).returncode == 0


another_stack = pytest.mark.skipif(
    not has_node_opcua(),
    reason="another stack is not here: npm install node-opcua-client, and NODE_PATH=.../node_modules",
)


def read_by_node_client(server, *who):
    ran = subprocess.run(
        ["node", str(CLIENT), server.url, "cell", "x", *who],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        timeout=50,
    )
    return json.loads(ran.stdout.splitlines()[-1])


@another_stack
def test_a_client_of_another_stack_sees_it_all_and_without_a_name_calls_nothing(server, machine):
    good(server.url)
    seen = read_by_node_client(server)
    assert seen["axes"] == ["x", "y"]
    assert sorted(seen["methods"]) == ["Halt", "Stop"]
    assert seen["variables"]["PositionActualValue"]["unit"] == {"symbol": "deg", "number": 17476}
    assert seen["variables"]["AxisState"]["text"] == "Disabled"
    assert seen["variables"]["AxisState"]["states"][0] == [0, "Disabled"]
    assert seen["positions"][0][1] == "Good"
    assert "BadUserAccessDenied" in seen["halt"][0]
    assert "BadUserAccessDenied" in seen["written"]


@another_stack
def test_a_client_of_another_stack_with_a_name_halts_and_writes_nothing(server, machine):
    good(server.url)
    seen = read_by_node_client(server, "anna", "right")
    assert seen["halt"] == ["Good", "x: Disabled at 0 deg"]
    assert seen["written"] == "BadNotWritable"


@another_stack
def test_a_client_of_another_stack_receives_refusals(server):
    server.follow(None)
    seen = read_by_node_client(server, "anna", "right")
    assert seen["halt"][0] == "BadNoCommunication"
    (event,) = seen["events"]
    message, severity, cause, remedy, axis = event
    assert "anna" in message
    assert severity == 500
    assert "no machine is running" in cause
    assert (remedy, axis) == ("", "x")
    assert all(status.startswith("Bad") for _, status in seen["positions"])
