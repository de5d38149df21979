"""Settings of a module by messages only, each sent after idle was seen."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine
from axisbus.drives.gim6010.bus.settings_by_message import ModuleByMessage
from axisbus.drives.gim6010.sim.constants import AxisError
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import LimitError, NodeError, StateError
from kit.can_simple_bus import modules_on_bus


@contextmanager
def opened(*modules):
    with ExitStack() as stack:
        name = stack.enter_context(modules_on_bus(*modules))
        channel = Channel.open("virtual", name)
        stack.callback(channel.close)
        line = SimpleLine(channel, modules[0].node_id)
        found = ModuleByMessage(line)
        stack.enter_context(line)
        yield found


def limits_of(module):
    return [
        module.usb_read(path)
        for path in ("axis0.controller.config.vel_limit", "axis0.motor.config.current_lim")
    ]


def test_limits_are_set():
    module = Module(5)
    with opened(module) as found:
        with pytest.raises(LimitError):
            found.set_limits(20.0, 50.5)
        found.set_limits(20.0, 15.0)
    assert limits_of(module) == [20.0, 15.0]


def test_zero_sets_the_count_to_0_at_the_present_position():
    module = Module(5)
    module.motor.position = 5000.0
    with opened(module) as found:
        found.set_zero()
    assert abs(module.shaft.shadow_count) <= 1
    assert module.shaft.count_in_turn == 5000


def test_a_count_that_does_not_become_0_is_reported():
    module = Module(5)
    module._talk._commands.pop(0x19)
    with opened(module) as found, pytest.raises(NodeError, match="has the count 5000"):
        found.set_zero()


def test_an_output_that_turns_is_not_zeroed():
    module = Module(5)
    module.motor.pull = -21.0  # ‰, a little more than its friction
    with opened(module) as found, pytest.raises(StateError, match="turns"):
        found.set_zero()
    assert module.shaft.shadow_count > 1000


def test_an_error_is_cleared_and_one_that_stays_is_reported():
    module = Module(5)
    module.axis.error |= AxisError.CAN_BUS_FAILED
    with opened(module) as found:
        found.clear()
        assert module.axis.error == 0
        module.dials.bus_voltage = 5.0
        with pytest.raises(NodeError, match="00000040h"):
            found.clear()


@pytest.mark.parametrize(
    "act", [lambda m: m.set_limits(20.0, 15.0), lambda m: m.set_zero(), lambda m: m.clear()]
)
def test_no_setting_is_sent_to_an_enabled_module(act):
    module = Module(5)
    module.on_frame(5 << 5 | 7, (8).to_bytes(8, "little"), 0.0)
    before = limits_of(module), module.shaft.origin
    with opened(module) as found, pytest.raises(StateError, match="closed loop"):
        act(found)
    assert (limits_of(module), module.shaft.origin) == before
    assert module.energised


def test_no_setting_is_sent_to_a_module_without_a_heartbeat():
    module = Module(5, heartbeat_rate_ms=0)
    with opened(module) as found, pytest.raises(StateError, match="no heartbeat"):
        found.set_limits(20.0, 15.0)
    assert limits_of(module) == [30, 45]
