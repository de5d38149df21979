"""A change of node ID, protocol or bit rate, killed before each frame: ``find`` explains the remaining state; in virtual time."""

from __future__ import annotations

import json
from contextlib import suppress

import pytest

from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine
from axisbus.drives.gim6010.bus.endpoints import CanSimpleParameters
from axisbus.drives.gim6010.bus.settings_by_message import set_node_id
from axisbus.drives.gim6010.can_simple.endpoints import Firmware, parse
from axisbus.drives.gim6010.discovery import report_text
from axisbus.drives.gim6010.discovery.finder import ProbeScope
from axisbus.drives.gim6010.settings.parameter_settings import apply, bit_rate
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from kit.module_search import search
from kit.sim.can_simple_module import SAVE, gim_eds
from kit.virtual_channel import Killed, KilledChannel

EDS = gim_eds()


def set_id(channel):
    set_node_id(channel, 5, 7, save=True, tell=lambda _: None)


def parameters(channel, act):
    line = SimpleLine(channel, 5)
    found = CanSimpleParameters(line)
    with line:
        found.open(parse(json.dumps(channel.foreign_nodes[0].json()), "a list"), Firmware(0, 5, 13))
        act(found)


def to_canopen(channel):
    def act(module):
        module.write("can.config.protocol", 2, by_name=True)
        module.save_and_leave()

    parameters(channel, act)


def set_bitrate(channel):
    def act(module):
        apply(module, bit_rate(1_000_000), lambda _: None)
        module.save_and_leave()

    parameters(channel, act)


# The settings before, and after they were saved: protocol, node ID, bit rate; and the number of frames, of which the
# last saves, and of parameters the two before write and read back.
OLD = ("CAN Simple", 5, 500_000)
PLAYS = {
    "set-id": (set_id, ("CAN Simple", 7, 500_000), 2),
    "to-canopen": (to_canopen, ("CANopen", 5, 500_000), 8),
    "set-bitrate": (set_bitrate, ("CAN Simple", 5, 1_000_000), 9),
}


def played(name, killed_at=None):
    module = Module(5, eds=EDS, dials=ModuleFaults(line_bitrate=500_000, restart_time=0.7))
    channel = KilledChannel(module, killed_at=killed_at)
    with suppress(Killed), channel:
        PLAYS[name][0](channel)
    return module, channel


def explained(module, rate, since, ask=ProbeScope.HEARD):
    """The report of ``find`` at a bit rate."""
    module.dials.line_bitrate = rate
    found = search(module, ask=ask, since=since).found
    for each in found.values():
        assert each.state is not None
        assert not each.several
        assert any(str(each.node) in line for line in report_text.lines(each))
        assert report_text.following([each], "-i socketcan -c can0")
    return [(protocol, node, rate) for protocol, node in found]


@pytest.mark.parametrize("name", PLAYS)
def test_the_number_of_frames_of_each_dialogue_and_its_result(name):
    module, channel = played(name)
    _, after, frames = PLAYS[name]
    assert len(channel.sent) == frames
    assert [number for number, (can_id, _) in enumerate(channel.sent) if can_id & 0x1F == SAVE] == [
        frames - 1
    ]
    assert explained(module, after[2], channel.clock.now(), ProbeScope.ALL) == [after]


@pytest.mark.parametrize(
    ("name", "killed_at"),
    [
        (name, at)
        for name, (_, _, frames) in PLAYS.items()
        for at in sorted({0, *range(max(0, frames - 3), frames)})
    ],
)
def test_a_dialogue_killed_before_any_frame_leaves_the_old_settings_after_a_restart(name, killed_at):
    module, channel = played(name, killed_at)
    assert len(channel.sent) == killed_at
    in_ram = ("CAN Simple", module.node_id, 500_000)
    assert explained(module, 500_000, channel.clock.now()) == [in_ram]
    assert in_ram == OLD or (name, killed_at) == ("set-id", 1)  # the new ID holds at once, and unsaved
    module.dials.restart_time = 0.0
    module.restart()
    assert explained(module, 500_000, channel.clock.now() + 10.0) == [OLD]
    assert not module.energised
