"""From the factory's state to CANopen on one simulated module, and cut off at each step."""

from __future__ import annotations

import json
import time
from contextlib import ExitStack

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.drives.gim6010.bus.settings_by_message import set_node_id
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import NodeError, StateError
from kit import command_line
from kit.can_simple_bus import modules_on_bus
from kit.sim.can_simple_module import gim_eds

EDS = gim_eds()


@pytest.fixture
def axisbus(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "endpoints_0.5.13.json").write_text(json.dumps(Module().json()), "utf-8")
    return command_line.runner(monkeypatch, capsys)


def bus(channel, *more):
    return ("-i", "virtual", "-c", channel, *more)


LIST = ("--list", "endpoints_0.5.13.json")


@pytest.mark.timeout(180)
def test_from_the_box_to_canopen(axisbus):
    module = Module(0, eds=EDS)
    with modules_on_bus(module) as channel:
        code, out, _ = axisbus("gim6010", "find", *bus(channel))
        assert (code, "node 0: CAN Simple" in out) == (0, True)
        code, _, err = axisbus("gim6010", "to-canopen", *bus(channel, "--node", 0), *LIST)
        assert (code, "set-id" in err) == (1, True)
        code, out, _ = axisbus("gim6010", "set-id", 5, *bus(channel, "--node", 0))
        assert code == 0
        assert "saved: it restarted, and is node 5" in out
        assert (module.node_id, module.restarts) == (5, 1)
        code, out, err = axisbus("gim6010", "to-canopen", *bus(channel, "--node", 5), *LIST)
        assert code == 0, err
        assert "node 5 speaks CANopen" in out
        assert module.protocol == 2
        code, out, _ = axisbus("gim6010", "find", *bus(channel))
        assert (code, "node 5: CANopen" in out) == (0, True)
        code, out, _ = axisbus("gim6010", "to-can-simple", *bus(channel, "--node", 5))
        assert code == 1
        assert "odrv0.can.config.protocol = 1" in out
    assert not module.energised


@pytest.mark.timeout(120)
def test_if_the_protocol_can_be_set_by_usb_only_the_steps_are_printed(axisbus):
    module = Module(5, eds=EDS, dials=ModuleFaults(protocol_by_usb=True))
    with modules_on_bus(module) as channel:
        code, out, err = axisbus("gim6010", "to-canopen", *bus(channel, "--node", 5), *LIST)
    assert code == 3
    assert "holds 1 after 2 was written" in err
    assert "odrv0.can.config.protocol = 2" in out
    assert module.restarts == 0


@pytest.mark.timeout(120)
def test_a_node_id_that_is_taken_is_refused_and_nothing_is_sent(axisbus):
    modules = [Module(5), Module(6)]
    with modules_on_bus(*modules) as channel:
        code, _, err = axisbus("gim6010", "set-id", 6, *bus(channel, "--node", 5))
    assert code == 1
    assert "another module has the node ID 6" in err
    assert [each.node_id for each in modules] == [5, 6]
    assert axisbus("gim6010", "set-id", 5, *bus("x", "--node", 5)).code == 2


# -- each step cut off ----------------------------------------------------------------------------------------------------------


class Cut(BaseException):
    """Ctrl-C."""


def change(channel_name, old, new, *, save=True, tell=lambda _: None):
    with ExitStack() as stack:
        channel = Channel.open("virtual", channel_name)
        stack.callback(channel.close)
        set_node_id(channel, old, new, save=save, tell=tell)


def found(axisbus, channel):
    modules = json.loads(axisbus("gim6010", "find", *bus(channel, "--json", "--ask", "heard")).out)["modules"]
    return [(each["protocol"], each["node_id"], each["several"]) for each in modules]


@pytest.mark.timeout(120)
def test_cut_off_before_the_save_the_new_id_is_found_until_it_is_switched_off(axisbus):
    module = Module(5, dials=ModuleFaults(restart_time=0.2))

    def cut(_):
        raise Cut

    with modules_on_bus(module) as channel:
        with pytest.raises(Cut):
            change(channel, 5, 7, tell=cut)
        assert found(axisbus, channel) == [("CAN Simple", 7, False)]
        module.restart()
        time.sleep(0.3)
        assert found(axisbus, channel) == [("CAN Simple", 5, False)]


@pytest.mark.timeout(120)
def test_cut_off_after_the_save_it_has_the_new_id(axisbus):
    module, told = Module(5), []

    def cut(text):
        told.append(text)
        if len(told) == 2:
            raise Cut

    with modules_on_bus(module) as channel:
        with pytest.raises(Cut):
            change(channel, 5, 7, tell=cut)
        module.restart()
        time.sleep(1.6)
        assert found(axisbus, channel) == [("CAN Simple", 7, False)]


def test_a_module_that_does_not_accept_the_id_is_reported():
    module = Module(5)
    module._talk._commands.pop(6)
    with modules_on_bus(module) as channel, pytest.raises(NodeError, match="does not accept the node ID 7"):
        change(channel, 5, 7)
    assert module.restarts == 0


def test_a_module_that_does_not_keep_the_id_is_reported():
    module = Module(5, dials=ModuleFaults(restart_time=1.0))
    module.parameters.save = lambda: None
    with modules_on_bus(module) as channel, pytest.raises(NodeError, match="came back with the node ID 5"):
        change(channel, 5, 7)


def test_a_module_that_does_not_restart_is_reported():
    module = Module(5)
    module._talk._commands.pop(0x1F)
    with modules_on_bus(module) as channel, pytest.raises(NodeError, match="does not restart"):
        change(channel, 5, 7)


def test_an_enabled_module_keeps_its_id():
    module = Module(5)
    module.on_frame(5 << 5 | 7, (8).to_bytes(8, "little"), 0.0)
    with modules_on_bus(module) as channel, pytest.raises(StateError, match="closed loop"):
        change(channel, 5, 7)
    assert module.node_id == 5


def test_an_id_with_heartbeats_of_another_module_is_not_given():
    modules = [Module(5), Module(7)]
    with (
        modules_on_bus(*modules) as channel,
        pytest.raises(StateError, match="another module sends heartbeats"),
    ):
        change(channel, 5, 7)
    assert [each.node_id for each in modules] == [5, 7]
