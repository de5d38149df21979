"""``axisbus boot CELL --reconnect`` beside a program that runs the machine: its core opens the adapter again."""

from __future__ import annotations

import errno
import socket
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.link.socketpair_bus import PairBus
from axisbus.core.process import server
from axisbus.errors import AdapterError, ScanError
from axisbus.ipc.rescue_memory import CoreStage
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.core_in_threads import core_in_threads
from kit.scenarios.core_process import OWN_PROCESS, own_cell
from kit.scenarios.simulated_bus import until

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]


class Adapter:
    """The adapter of a core: a line to simulated drives, which can be unplugged and plugged in again."""

    def __init__(self) -> None:
        self.channel: Channel | None = None
        self.away = False
        self.spare: socket.socket | None = None
        self.stages: list[CoreStage] = []
        self._reach = server.open_bus
        self._stage = server.CoreServer._stage

    def open_bus(self, cell, drives=None) -> Channel:
        """As ``bus_factory.open_bus``, with a way to open the line again."""
        self.spare = spare = drives.dup()
        self.channel = self._reach(cell, drives)

        def opener() -> tuple[PairBus, None]:
            if self.away:
                raise AdapterError("the CAN adapter cannot be opened")
            return PairBus(spare.dup()), None

        self.channel.behind = None
        self.channel._opener = opener
        return self.channel

    def note(self, core, stage: CoreStage) -> None:
        """As ``CoreServer._stage``."""
        self.stages.append(stage)
        self._stage(core, stage)

    def unplug(self, machine: Machine) -> None:
        """Receive and send nothing any more, until ``away`` is false and the adapter is opened again."""
        self.away = True
        assert self.channel is not None

        def gone(*_: object) -> None:
            raise OSError(errno.ENODEV, "No such device")

        self.channel.bus.send = self.channel.bus.recv = gone
        for _ in range(600):
            if machine.session.failed:
                break
            machine.sleep(0.05)
        assert machine.session.failed
        machine.sleep(3.0)


@pytest.fixture
def file(tmp_path) -> Path:
    return own_cell(tmp_path)


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    made = Adapter()
    with (
        mock.patch.object(server, "open_bus", made.open_bus),
        mock.patch.object(server.CoreServer, "_stage", lambda core, stage: made.note(core, stage)),
    ):
        yield made
    if made.spare is not None:
        made.spare.close()


@pytest.fixture
def opened(file, adapter) -> Iterator[Machine]:
    with core_in_threads(), Machine.open(file) as machine:
        yield machine


def energised(machine: Machine) -> list[int]:
    """The nodes whose drive is in operation enabled, by its own statusword."""
    return [node for node in (1, 2) if machine.simulated_node(node).drive().statusword & 0x6F == 0x27]


def test_an_adapter_that_is_plugged_in_again_serves_the_machine_of_the_program(
    axisbus, opened, file, adapter
):
    for axis in opened:
        axis.enable().wait(20)
    handle = opened["x"].move_velocity(30.0)
    handle.wait(20)
    running = opened["y"].move_relative(1000.0, velocity=10.0)
    adapter.unplug(opened)
    assert isinstance(running.exception(), ScanError)
    until(lambda: adapter.stages[-1] is CoreStage.WAITING)
    code, _, err = axisbus("boot", file, "--reconnect", "--take")
    assert code == 3
    assert "the CAN adapter cannot be opened" in err
    adapter.away = False
    code, out, err = axisbus("boot", file, "--reconnect", "--take")
    assert code == 0, out + err
    assert adapter.stages[-1] is CoreStage.RUNNING
    assert "the CAN adapter was opened again; every axis is in ErrorStop\n" in out
    assert out.count("written and read back") == 2
    assert f"next: axisbus reset {file} x y" in out
    assert not opened.session.ended
    assert energised(opened) == []
    assert [axis.state for axis in opened] == [AxisState.ERRORSTOP] * 2
    assert axisbus("reset", file, "x", "y", "--take").code == 0
    for axis in opened:
        axis.enable().wait(20)
        axis.move_relative(1.0).wait(20)


def test_the_program_itself_opens_the_adapter_again(opened, adapter):
    adapter.unplug(opened)
    adapter.away = False
    opened.reconnect()
    assert opened.node(1).boot().ok
    opened["x"].reset().wait(20)
    opened["x"].enable().wait(20)
    opened["x"].move_relative(1.0).wait(20)


def test_an_adapter_that_works_is_left_as_it_is(axisbus, opened, file):
    code, _, err = axisbus("boot", file, "--reconnect", "--take")
    assert code == 1
    assert "it works" in err
    assert not opened.session.ended


def test_without_a_machine_it_names_the_usual_command(axisbus, file):
    code, _, err = axisbus("boot", file, "--reconnect")
    assert code == 1
    assert f"to boot all nodes: axisbus boot {file}" in err
