"""A core whose program or watchdog process ends while it opens a cell does not run: nothing would stop its axes."""

from __future__ import annotations

import os
import socket
from contextlib import suppress

import pytest

from axisbus.core.process.listener import StopRequest, machines_of
from axisbus.core.process.server import CoreServer
from axisbus.errors import ScanError, StateError
from axisbus.ipc.rescue_memory import CoreStage, LifelineWriter
from axisbus.machine.machine import Machine
from kit.core_in_threads import core_in_threads
from kit.scenarios.core_process import OWN_PROCESS, own_cell

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
WHY = "the watchdog process of the core has ended"


@pytest.fixture
def stages(monkeypatch) -> list[CoreStage]:
    found: list[CoreStage] = []
    monkeypatch.setattr(LifelineWriter, "stage", lambda _, stage: found.append(stage))
    return found


@pytest.mark.parametrize("step", ["_await_watchdog", "_take_signals"])
def test_a_machine_is_not_opened_if_its_core_has_to_leave_before(tmp_path, monkeypatch, stages, step):
    """Before the nodes are booted, and when the scan is about to begin."""
    with core_in_threads():
        do = getattr(CoreServer, step)
        monkeypatch.setattr(CoreServer, step, lambda server: (do(server), server._leave(WHY)))
        with pytest.raises(ScanError, match=f"the machine was not opened: {WHY}"):
            Machine.open(own_cell(tmp_path, "x"))
    assert CoreStage.RUNNING not in stages


def test_a_machine_is_closed_if_its_core_has_to_leave_when_it_has_just_been_opened(tmp_path, monkeypatch):
    opened = CoreServer._opened

    def leave(server):
        server._leave(WHY)
        return opened(server)

    monkeypatch.setattr(CoreServer, "_opened", leave)
    with core_in_threads(), Machine.open(own_cell(tmp_path, "x")) as machine:
        machine.session.waiter.wait(lambda: machine.session.ended, 20.0)
        assert machine.session.left[1] == WHY


def connect_at(monkeypatch, step, cell, *words):
    """Programs that connect to the core when it has done a step of opening, say some words each, and do not wait."""
    do = getattr(CoreServer, step)
    lines = []

    def connect(server):
        do(server)
        (claim,) = machines_of(cell)
        for each in words:
            line = socket.socket(socket.AF_UNIX)
            line.connect(claim.name)
            line.sendall(each)
            lines.append(line)

    monkeypatch.setattr(CoreServer, step, connect)
    return lines


@pytest.mark.parametrize(
    "axes", [(), ("x",), tuple(f"an axis of a long name {number}" for number in range(500))]
)
@pytest.mark.parametrize("step", ["_await_watchdog", "_take_signals"])
def test_a_machine_is_not_opened_if_a_stop_was_requested_meanwhile(tmp_path, monkeypatch, stages, step, axes):
    """The stop ended before the nodes were booted: a program that ran now would move what was reported as stopped."""
    cell = own_cell(tmp_path, "x")
    silent = [b""] * 20  # more than are accepted at once
    with core_in_threads():
        lines = connect_at(monkeypatch, step, cell, *silent, b"a", StopRequest(axes).pack())
        with pytest.raises(StateError, match="axes were to be stopped meanwhile") as caught:
            Machine.open(cell)
    assert f"process {os.getpid()}" in caught.value.observed
    assert CoreStage.RUNNING not in stages
    for line in lines:
        line.close()


def test_a_halt_or_a_program_that_joins_during_opening_has_to_wait_only(tmp_path, monkeypatch):
    cell = own_cell(tmp_path, "x")
    halt = StopRequest(("x",), quick=False).pack()
    with core_in_threads():
        lines = connect_at(monkeypatch, "_take_signals", cell, b"a", b"x", halt, b"a")
        with Machine.open(cell) as machine:
            for line in (lines[0], lines[3]):
                words, images, *_ = socket.recv_fds(line, 1, 1)
                assert (words, len(images)) == (b"a", 1)
                os.close(images[0])
            with suppress(ConnectionResetError):
                assert lines[1].recv(1) == b""  # its words are unknown
            with lines[2].makefile() as answers:
                assert float(answers.readline()) > 0.0
            machine["x"].enable().wait(20.0)
            for line in lines:
                line.close()
