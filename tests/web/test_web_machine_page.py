"""A program serves the page of its machine: control meanwhile, and the ends of the page."""

from __future__ import annotations

import http.client
import signal
import socket
import subprocess
import sys

import pytest

pytest.importorskip("nicegui", reason="the page needs nicegui")

from axisbus.errors import OwnershipError, StateError
from axisbus.machine.machine import Machine
from kit.cell import cell_file
from kit.scenarios.core_process import OWN_PROCESS, own_cell
from kit.served_page import until

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
PROGRAM = """
import sys, time
from axisbus import Machine
with Machine.open(sys.argv[1]) as machine:
    print(machine.serve_web().link, flush=True)
    time.sleep(100)
"""


def host_of(link):
    return link.split("/")[2]


def answer(link):
    """The status of the answer to a link; 0 without a server."""
    line = http.client.HTTPConnection(host_of(link), timeout=5)
    try:
        line.request("GET", link[link.index("/enter") :])
        return line.getresponse().status
    except ConnectionError:
        return 0
    finally:
        line.close()


def test_a_page_looks_on_and_ends_with_its_machine(tmp_path):
    with Machine.open(own_cell(tmp_path)) as machine:
        page = machine.serve_web()
        assert page.runs
        assert answer(page.link) == 200
        machine["x"].enable().wait(10)  # the program still has control
        with pytest.raises(StateError, match="could not be served") as caught:
            machine.serve_web(port=int(host_of(page.link).rpartition(":")[2]))
        assert "in use" in caught.value.observed
        assert page.runs
    assert not page.runs
    assert answer(page.link) == 0
    page.close()


def test_a_page_with_control_returns_it_at_its_end(tmp_path):
    with Machine.open(own_cell(tmp_path)) as machine:
        with machine.serve_web(command=True) as page, pytest.raises(OwnershipError, match="axisbus web"):
            machine["x"].enable().wait(10)
        assert not page.runs
        machine["x"].enable().wait(10)


def test_a_page_that_is_killed_changes_nothing(tmp_path):
    with Machine.open(own_cell(tmp_path)) as machine:
        page = machine.serve_web()
        machine["x"].enable().wait(10)
        handle = machine["x"].move_relative(50.0)
        page._process.kill()
        until(lambda: not page.runs)
        handle.wait(30)


def test_a_page_ends_if_its_program_is_killed(tmp_path):
    command = [sys.executable, "-c", PROGRAM, str(own_cell(tmp_path))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        link = program.stdout.readline().strip()
        assert answer(link) == 200
        program.send_signal(signal.SIGKILL)
        address = host_of(link).split(":")
        until(lambda: not listens(address), within=40.0)


def listens(address):
    with socket.socket() as line:
        return line.connect_ex((address[0], int(address[1]))) == 0


def test_a_machine_that_cannot_be_joined_has_no_page(tmp_path):
    file = cell_file(tmp_path)
    with Machine.simulated(file) as machine, pytest.raises(StateError, match="no page can be served"):
        machine.serve_web()
