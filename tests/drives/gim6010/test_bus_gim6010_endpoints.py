"""Parameters by endpoints of a simulated module: proven lists, writes that are read back, and whatever may come between."""

from __future__ import annotations

import json
import time
from contextlib import ExitStack, contextmanager, suppress

import can
import pytest

from axisbus.bus.link.channel import Channel
from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine
from axisbus.drives.gim6010.bus.endpoints import CanSimpleParameters
from axisbus.drives.gim6010.can_simple.endpoints import Firmware, parse
from axisbus.drives.gim6010.sim.constants import Firmware as Made
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import ArgumentError, NodeError, NodeTimeout, StateError
from kit.can_simple_bus import Bystander, modules_on_bus
from kit.lossy_line import LossyLine

V13 = Firmware(0, 5, 13)
LIMIT = "axis0.controller.config.vel_limit"


def list_of(module):
    return parse(json.dumps(module.json()), "endpoints.json")


@contextmanager
def opened(*modules, listed=None, made_for=V13, node=None, bystander=None, line=None):
    """The first module, opened on a bus with all of them."""
    with ExitStack() as stack:
        name = stack.enter_context(modules_on_bus(*modules))
        if bystander is not None:
            bystander.append(stack.enter_context(Bystander(name)))
        if line is not None:
            name = stack.enter_context(line(name))
        channel = Channel.open("virtual", name)
        stack.callback(channel.close)
        simple = SimpleLine(channel, modules[0].node_id if node is None else node)
        found = CanSimpleParameters(simple)
        stack.enter_context(simple)
        found.open(listed or list_of(modules[0]), made_for)
        yield found


@pytest.mark.parametrize("node", [0, 5, 63])
@pytest.mark.parametrize("answer", [0x04, 0x05])
def test_a_written_value_is_read_back_and_a_restart_reverts_it(node, answer):
    module = Module(node, dials=ModuleFaults(endpoint_answer=answer, restart_time=0.2))
    with opened(module) as found:
        assert (found.firmware, found.serial) == (V13, 0x32323334)
        assert found.read("vbus_voltage") == 24.0
        assert found.write(LIMIT, 12.5) == 12.5
        assert module.usb_read(LIMIT) == 12.5
        assert found.written == {LIMIT: 12.5}
        module.restart()
        time.sleep(0.6)
        with pytest.raises(NodeError, match="restarted meanwhile"):
            found.read(LIMIT)
    assert module.usb_read(LIMIT) == 30
    assert not module.energised


@pytest.mark.parametrize("firmware", [Made(0, 5, 11), Made(0, 5, 13)])
def test_a_saved_endpoint_is_kept_over_a_restart(firmware):
    module = Module(5, firmware=firmware)
    with opened(module, made_for=Firmware(*firmware)) as found:
        found.write(LIMIT, 12.5)
        found.save()
        assert found.written == {}
        assert found.read(LIMIT) == 12.5
    assert module.restarts == 1


def test_a_module_without_heartbeats_is_served_too():
    module = Module(5, heartbeat_rate_ms=0, encoder_rate_ms=0)
    with opened(module) as found:
        found.write(LIMIT, 12.5)
        found.save()
        assert found.read(LIMIT) == 12.5
        module.on_frame(5 << 5 | 7, (8).to_bytes(8, "little"), 0.0)
        with pytest.raises(StateError, match="closed loop"):
            found.write(LIMIT, 13.0)


def test_an_enabled_module_is_neither_written_nor_saved():
    module = Module(5)
    with opened(module) as found:
        module.on_frame(5 << 5 | 7, (8).to_bytes(8, "little"), 0.0)
        time.sleep(0.25)
        for act in (lambda: found.write(LIMIT, 12.5), found.save):
            with pytest.raises(StateError, match="closed loop"):
                act()
        assert found.read(LIMIT) == 30
    assert module.restarts == 0


def test_parameters_that_act_are_refused_before_anything_is_sent():
    seen = []
    with opened(Module(5), bystander=seen) as found:
        time.sleep(0.1)
        before = len(seen[0].heard)
        for path, value in (
            ("axis0.requested_state", 8),
            ("axis0.controller.input_vel", 1.0),
            ("axis0.config.can.node_id", 7),
        ):
            with pytest.raises(ArgumentError):
                found.write(path, value, by_name=True)
        with pytest.raises(ArgumentError, match="protected"):
            found.write("axis0.motor.config.torque_constant", 0.2)
        time.sleep(0.1)
        assert [each for each in seen[0].heard[before:] if each.arbitration_id & 0x1F in (4, 5)] == []


# -- lists that do not fit ------------------------------------------------------------------------------------------------------


def test_a_list_of_another_version_is_refused():
    module = Module(5, firmware=Made(0, 6, 0))
    with (
        pytest.raises(ArgumentError, match=r"made for firmware 0.5.13, and the module has 0.6.0"),
        opened(module),
    ):
        pass


def test_an_endpoint_list_of_the_right_version_still_has_its_types_tested():
    """It is called 0.6.0, as the module's firmware is, and is that of 0.5.13: only 9, 10 and 11 are asked, and the node ID."""
    module, seen = Module(5, firmware=Made(0, 6, 0)), []
    wrong = list_of(Module(5, firmware=Made(0, 5, 13)))
    with (
        pytest.raises((ArgumentError, NodeTimeout)),
        opened(module, listed=wrong, made_for=Firmware(0, 6, 0), bystander=seen),
    ):
        pass
    asked = {each.data[1] | each.data[2] << 8 for each in seen[0].heard if each.arbitration_id == 5 << 5 | 4}
    assert asked == {9, 10, 11, wrong.endpoints["axis0.config.can.node_id"].id}
    assert module.restarts == 0


# -- interruptions ----------------------------------------------------------------------------------------------------------------


def test_a_module_that_answers_no_endpoint_is_reported_with_the_remedy():
    with pytest.raises(NodeTimeout, match="USB"), opened(Module(5, dials=ModuleFaults(endpoints=False))):
        pass


def test_answers_of_wrong_lengths_are_reported():
    """Another device answers instead, with too few bytes."""

    def answer(message):
        if message.arbitration_id == 5 << 5 | 4 and len(message.data) == 8:
            return [can.Message(arbitration_id=5 << 5 | 4, data=bytes(3), is_extended_id=False)]
        return []

    def beside(name):
        return Bystander(name, answer=answer)

    with ExitStack() as stack:
        name = stack.enter_context(modules_on_bus(Module(5, dials=ModuleFaults(endpoints=False))))
        stack.enter_context(beside(name))
        channel = Channel.open("virtual", name)
        stack.callback(channel.close)
        simple = SimpleLine(channel, 5)
        found = CanSimpleParameters(simple)
        stack.enter_context(simple)
        with pytest.raises(NodeTimeout, match="too short"):
            found.open(list_of(Module(5)), V13)


def test_two_modules_of_one_id_are_noticed_by_heartbeats_or_by_answers():
    for quiet in ({}, {"heartbeat_rate_ms": 0, "encoder_rate_ms": 0}):
        other = Module(5, serial=2, **{"heartbeat_rate_ms": 90, **quiet})
        with pytest.raises(NodeError, match="several modules"), opened(Module(5, serial=1, **quiet), other):
            pass


def test_no_value_is_written_while_another_program_sends_requests():
    seen = []
    with opened(Module(5), bystander=seen) as found:
        other = can.Bus(interface="virtual", channel=found.line.channel.bus.channel_id)
        other.send(
            can.Message(arbitration_id=5 << 5 | 4, data=bytes([0, 2, 0, 0, 0, 0, 0, 0]), is_extended_id=False)
        )
        time.sleep(0.1)
        with pytest.raises(NodeError, match=r"several modules|somebody else"):
            found.write(LIMIT, 12.5)
        other.shutdown()


def test_a_value_that_the_module_does_not_take_is_reported():
    module = Module(5)
    with opened(module) as found:
        module.endpoints.write_bytes = lambda *_: None
        with pytest.raises(NodeError, match=r"holds 30 after 12.5 was written"):
            found.write(LIMIT, 12.5)
        assert found.written == {}


def test_a_module_that_leaves_is_reported():
    module = Module(5)
    with opened(module) as found:
        module.dials.dead = True
        with pytest.raises(NodeTimeout, match="does not answer"):
            found.read(LIMIT)
        time.sleep(0.8)
        with pytest.raises(NodeError, match="no longer sends heartbeats"):
            found.write(LIMIT, 12.5)


def test_a_restart_between_writing_and_saving_is_not_saved():
    module = Module(5, dials=ModuleFaults(restart_time=0.2))
    with opened(module) as found:
        found.write(LIMIT, 12.5)
        module.restart()
        time.sleep(0.5)
        with pytest.raises(NodeError, match="restarted meanwhile"):
            found.save()
    assert module.restarts == 1


def test_a_save_that_does_nothing_is_reported():
    module = Module(5)
    with opened(module) as found:
        found.write(LIMIT, 12.5)
        module._talk._commands.pop(0x1F)
        with pytest.raises(NodeError, match="does not restart"):
            found.save()


def test_a_save_that_loses_the_values_is_reported():
    module = Module(5, dials=ModuleFaults(restart_time=0.3))
    with opened(module) as found:
        found.write(LIMIT, 12.5)
        module.parameters.save = lambda: None
        with pytest.raises(NodeError, match=r"has lost axis0.controller.config.vel_limit"):
            found.save()


@pytest.mark.parametrize("seed", range(3))
def test_lost_frames_end_in_the_value_or_in_an_error_and_never_in_a_wrong_one(seed):
    module, wrong, written, failed = Module(5), [], [], []
    with (
        suppress(NodeError),  # also opening may fail
        opened(module, line=lambda name: lossy(name, seed)) as found,
    ):
        for number in range(20):
            try:
                held = found.write(LIMIT, 10.0 + number)
            except NodeError as error:
                failed.append(error)
                continue
            written.append(held)
            if not held == module.usb_read(LIMIT) == 10.0 + number:
                wrong.append(number)
    assert wrong == []
    assert written or failed or module.usb_read(LIMIT) == 30


@contextmanager
def lossy(name, seed):
    with LossyLine(f"{name}-far", name, 0.1, seed) as line:
        yield f"{name}-far"
        assert line.carried
