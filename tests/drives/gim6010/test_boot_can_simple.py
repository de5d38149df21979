"""How boot evaluates heartbeats and answers of a module that speaks CAN Simple: its identity, or which node is there instead."""

from __future__ import annotations

from dataclasses import replace

import pytest

from axisbus.boot.stop_report import Watchdog
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.boot import identity
from axisbus.drives.gim6010.boot.identity import NodeListener
from axisbus.drives.gim6010.boot.module import WATCHDOG, ladder
from axisbus.drives.gim6010.can_simple.endpoints import Firmware
from axisbus.drives.gim6010.discovery.questions import SimpleFacts
from axisbus.errors import BootError
from axisbus.machine.machine import Machine
from axisbus.motion.parameters import HoldsLoad, StopTimes
from kit.can_simple.mixed_cell import AXES
from kit.can_simple.rig import SETTINGS

NODE = 16
BEAT = 0x201  # 16 times 32, and command 1 (manual v2.2, 4.1.1)


def heard(*frames: CanFrame) -> NodeListener:
    """The observations of node 16, by these frames."""
    listening = NodeListener(None, NODE)
    for frame in frames:
        listening._take(frame)
    return listening


def beats(count: int = 6, *, every: float = 0.1, life: int = 7, byte: int = 0) -> list[CanFrame]:
    """Heartbeats in idle; ``byte`` is that of the flags."""
    return [
        CanFrame(number * every, BEAT, bytes((0, 0, 0, 0, 1, byte, 0, life + number)))
        for number in range(count)
    ]


def refused(call, *given) -> str:
    with pytest.raises(BootError) as caught:
        call(*given)
    assert caught.value.node == NODE
    assert caught.value.remedy
    return str(caught.value)


def test_one_module_that_beats_as_from_the_factory_is_one():
    identity.require_one(heard(*beats()), 0.1)


def test_heartbeats_that_a_busy_computer_received_late_still_identify_the_module():
    late = [
        CanFrame(0.6 if frame.time in (0.3, 0.4, 0.5) else frame.time, frame.can_id, frame.data)
        for frame in beats()
    ]
    identity.require_one(heard(*late), 0.1)


@pytest.mark.parametrize(("count", "every", "words"), [(4, 0.2, "each 200 ms"), (1, 0.1, "only one")])
def test_the_report_on_a_module_with_a_slow_heartbeat_gives_the_required_period(count, every, words):
    told = refused(identity.require_one, heard(*beats(count, every=every)), 0.1)
    assert words in told
    assert "heartbeat_rate_ms to 100" in told


def test_two_of_one_node_id_are_reported_by_their_counts():
    both = sorted([*beats(), *beats(life=100)], key=lambda frame: frame.time)
    assert "several modules" in refused(identity.require_one, heard(*both), 0.1)


def test_a_firmware_that_its_endpoints_report_is_compared():
    listening = heard(*beats())
    facts = SimpleFacts(version=Firmware(0, 5, 13))
    identity.require_firmware(listening, facts, "0.5.13")
    identity.require_firmware(listening, facts, None)
    told = refused(identity.require_firmware, listening, facts, "0.5.14")
    assert "a firmware other than 0.5.14" in told
    assert "it reports 0.5.13" in told


def test_a_module_that_answers_no_endpoint_is_compared_by_its_heartbeats_alone():
    counted = heard(*beats())  # a life counter that counts: firmware 0.5.12 or later
    silent = SimpleFacts(silent=["endpoints"])
    identity.require_firmware(counted, silent, "0.5.12")
    assert "show firmware 0.5.12 or" in refused(identity.require_firmware, counted, silent, "0.5.11")
    assert "which it does not confirm" in identity.words(counted, silent, "0.5.13")
    system = heard(*beats(byte=8))  # the system's flag, which is in the newest layout alone
    assert "0.5.13 and later" in refused(identity.require_firmware, system, silent, "0.5.12")


def test_the_identity_of_a_module_as_text():
    facts = SimpleFacts(version=Firmware(0, 5, 13), serial=0x32333430)
    assert (
        identity.words(heard(*beats()), facts, None)
        == "firmware 0.5.13, by its endpoints, serial number ends in 32333430h"
    )


@pytest.mark.parametrize(
    ("frames", "message", "remedy"),
    [
        ([], "module 16 does not answer", "its node ID and bit rate"),
        ([CanFrame(0.0, 0x710, b"\x7f")], "node 16 uses CANopen", 'eds = "builtin:gim6010-8"'),
        (
            [CanFrame(0.0, 0x1920_0404, bytes(8), extended=True)],
            "29-bit protocol of firmware 0.6.8",
            "switch the module to CANopen",
        ),
    ],
)
def test_a_silent_module_is_reported_with_the_received_frames(frames, message, remedy):
    told = str(identity.no_answer_error(heard(*frames), 3.0, "nothing is wrong with the channel"))
    assert message in told
    assert remedy in told


def test_the_stop_sequence_of_a_module_names_the_steps_that_hold_and_those_that_coast():
    off = ladder("m", SETTINGS, StopTimes(), HoldsLoad.NO)
    rows = {title: text for title, _, text in off.rows}
    assert list(rows)[:4] == ["1 halt", "2 quick stop", "3 power off", "4 NMT stop"]
    assert "40 turns/s²" in rows["2 quick stop"]
    assert "then power off (at most 1 s" in rows["2 quick stop"]
    assert all("coasts" in rows[title] for title in ("3 power off", "4 NMT stop", "on a fault"))
    assert "continues" in rows["on a lost link"]
    assert "coasts" in off.warnings[0]


def test_the_stop_sequence_of_a_module_that_holds_after_a_quick_stop():
    held = ladder("m", replace(SETTINGS, quick_stop_holds=True), StopTimes(), HoldsLoad.TORQUE)
    rows = {title: text for title, _, text in held.rows}
    assert "holds its position" in rows["2 quick stop"]
    assert "never switched off before it is at standstill" in rows["holds a load"]


def test_no_monitoring_of_the_master_is_reported_for_a_module():
    assert WATCHDOG.kind is Watchdog.NONE
    for word in ("break_timeout", "watchdog_timeout", "CAN_BUS_FAILED", "untested"):
        assert word in WATCHDOG.text


def test_over_canopen_the_report_notes_that_break_timeout_is_not_read(tmp_path):
    (tmp_path / "cell.toml").write_text(
        """
[bus]
interface = "sim"
scan_period = "10ms"
[nodes.40]
eds = "builtin:gim6010-8"
"""
        + AXES.split("[axes.y]")[0]
    )
    with Machine.simulated(tmp_path / "cell.toml") as cell:
        (report,) = cell.reports
        assert "its break_timeout cannot be read over CANopen" in report.watchdog.text
        assert "watchdog --off" in report.watchdog.text
