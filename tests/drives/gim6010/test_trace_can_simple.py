"""CAN Simple in a trace: only the named nodes are decoded, and an ambiguous frame is shown with both meanings."""

from __future__ import annotations

import pytest

from axisbus.cell import reader
from axisbus.cia301.frame import CanFrame
from axisbus.core.files import load_dictionaries
from axisbus.drives.gim6010.trace import nodes_of
from axisbus.errors import ArgumentError
from axisbus.machine.bus_monitor import BusMonitor
from axisbus.trace import context
from axisbus.trace.decoded import FrameKind
from axisbus.trace.decoder import Decoder
from axisbus.trace.frame_formats import what
from kit import command_line
from kit.can_simple.mixed_cell import write


def decoded(can_id, data, nodes=(1, 5), **how):
    return Decoder(named={"can_simple": nodes}).feed(CanFrame(0.0, can_id, bytes.fromhex(data), **how))


@pytest.mark.parametrize(
    ("can_id", "data", "words"),
    [
        (
            0x0AC,
            "C3 F5 48 40 E8 03 88 13",
            "Set_Input_Pos: Input_Pos 3.14 turns (rotor), Vel_FF 1 turns/s (rotor), Torque_FF 5 N·m (rotor)",
        ),
        (0x027, "08 00 00 00 00 00 00 00", "Set_Axis_State: Axis_Requested_State 8 (closed loop)"),
        (
            0x029,
            "00 00 80 3F 00 00 00 00",
            "Get_Encoder_Estimates: Pos_Estimate 1 turns (rotor), Vel_Estimate 0 turns/s (rotor)",
        ),
        (
            0x029,
            "00 00 00 00 00 00 00 00",
            "Get_Encoder_Estimates: Pos_Estimate 0 turns (rotor), Vel_Estimate 0 turns/s (rotor) or asked for",
        ),
        (0x023, "01 00 00 00 00 00 00 00", "Get_Error: answer Error 1 or Error_Type 1 (encoder)"),
        (0x024, "00 02 00 00 00 00 C0 41", "RxSdo: read of endpoint 2 or its answer: 00 00 C0 41"),
        (0x022, "", "Estop: no data"),
        (0x021, "00 00 00 00 08 80 00 10", "Heartbeat: closed loop; trajectory done; life 16"),
        (0x035, "01", "command 15h: 01  !! command 15h: there is no such command"),
        (
            0x029,
            "01 02",
            "Get_Encoder_Estimates: 01 02  !! command 09h: it is too short (2 bytes where 8 are needed)",
        ),
    ],
)
def test_a_frame_of_a_named_node(can_id, data, words):
    one = decoded(can_id, data)
    assert one.kind is FrameKind.FOREIGN
    assert one.node == can_id >> 5
    assert what(one) == f"CAN Simple, {words}"


def test_mit_control_is_decoded_with_the_ranges_that_were_used():
    both = what(decoded(0x028, "01 80 00 80 08 00 00 00"))
    assert "answer position" in both
    assert " or command position" in both
    assert both.count("by the manual's ranges") == 2
    assert "answer" not in what(decoded(0x028, "80 00 80 00 00 00 08 00"))


def test_a_remote_frame_is_shown_as_a_request():
    assert what(decoded(0x034, "", remote=True)) == "CAN Simple, Get_Iq: asked for"
    assert not decoded(0x034, "", remote=True).from_node
    assert decoded(0x028, "", remote=True).trouble


def test_faults_and_missed_heartbeats_are_trouble():
    decoder = Decoder(named={"can_simple": [1]})
    tails = ["80 00 10", "80 00 13", "81 00 14"]
    told = [decoder.feed(CanFrame(0.0, 0x021, bytes.fromhex(f"40 00 00 00 01 {tail}"))) for tail in tails]
    assert "axis MOTOR_FAILED: the motor part reports an error" in what(told[0])
    assert "2 heartbeats missed before it" in told[1].problem
    assert "fault of motor" in what(told[2])
    assert all(each.trouble for each in told)


@pytest.mark.parametrize("how", [{"extended": True}, {"error": True}])
def test_frames_of_unnamed_nodes_are_left_alone(how):
    assert "CAN Simple" not in what(decoded(0x0AC, "C3 F5 48 40 E8 03 88 13", **how))
    assert "CAN Simple" not in what(decoded(0x0AC, "C3 F5 48 40 E8 03 88 13", nodes=(1,)))
    assert decoded(0x0AC, "C3 F5 48 40 E8 03 88 13", nodes=()).kind is FrameKind.EMCY


@pytest.mark.parametrize("text", ["64", "a", "1,,2", "-1", "0x1", "", "１"])
def test_an_invalid_node_is_refused(text):
    with pytest.raises(ArgumentError, match="is not a node ID of CAN Simple"):
        nodes_of(text)


def test_trace_and_filter_can_simple_on_the_command_line(monkeypatch, capsys, tmp_path):
    run = command_line.runner(monkeypatch, capsys)
    log = tmp_path / "run.log"
    log.write_text("(1.0) can0 00C#CDCC0C4000000000\n(1.1) can0 701#05\n")
    code, out, _ = run("trace", log, "--can-simple", "0, 5", "--filter", "node=0")
    assert code == 0
    assert "CAN Simple, Set_Input_Pos: Input_Pos 2.2 turns (rotor)" in out
    assert "701h" not in out
    code, _, err = run("trace", log, "--can-simple", "99")
    assert code != 0
    assert "'99' is not a node ID of CAN Simple" in err


def test_the_modules_of_a_cell_need_not_be_named(tmp_path):
    cell = reader.load(write(tmp_path, 'interface = "sim"'))
    one = Decoder(context.of_cell(cell, load_dictionaries(cell))).feed(CanFrame(0.0, 0x201, bytes(8)))
    assert (one.kind, one.node, one.name) == (FrameKind.FOREIGN, 16, "m")
    assert "Heartbeat" in what(one)


def test_a_monitor_of_a_cell_receives_the_heartbeats_of_its_module(tmp_path):
    cell = reader.load(write(tmp_path, 'interface = "sim"'))
    overview = BusMonitor(cell, load_dictionaries(cell))
    for number in range(5):
        overview.feed(CanFrame(0.1 * number, 0x201, bytes((0, 0, 0, 0, 1, 0, 0, number))), 0.1 * number)
    node = overview.nodes[16]
    assert node.name == "m"
    assert node.beat.intervals == pytest.approx((0.1, 0.1, 0.1))
    assert overview.unknown == 0
    assert overview.signs.heard == []
