"""The master's codecs and the simulated module, each written from the manual on its own, meet on one wire."""

from __future__ import annotations

import json
import struct

import pytest

from axisbus.drives.gim6010.can_simple import endpoint_messages, error_query, mit
from axisbus.drives.gim6010.can_simple import heartbeat as beats
from axisbus.drives.gim6010.can_simple.codec import DecodedMessage, Outgoing, decode, encode, request
from axisbus.drives.gim6010.can_simple.endpoints import Firmware, FittedList, parse
from axisbus.drives.gim6010.can_simple.error_query import ErrorType
from axisbus.drives.gim6010.can_simple.heartbeat import Heartbeat, Heartbeats
from axisbus.drives.gim6010.can_simple.messages import MESSAGES, MessageRequestMethod, named
from axisbus.drives.gim6010.sim.constants import Firmware as Made
from axisbus.drives.gim6010.sim.module import Module
from kit.sim.can_simple_module import Bench, Heard

GEAR = 8


def give(bench: Bench, frame: Outgoing) -> list[Heard]:
    return bench.send(frame.can_id, frame.data, remote=frame.remote)


def order(bench: Bench, name: str, **values: float) -> list[Heard]:
    return give(bench, encode(bench.node, named(name), values))


def asked(bench: Bench, name: str, *, remote: bool = True) -> dict[str, float]:
    (answer,) = give(bench, request(bench.node, named(name), remote=remote))
    found = decode(answer.can_id, answer.data, from_module=True)
    assert isinstance(found, DecodedMessage), found
    return dict(found.values)


def enabled(bench: Bench, control: int, inputs: int) -> None:
    order(bench, "Set_Controller_Mode", Control_Mode=control, Input_Mode=inputs)
    order(bench, "Set_Axis_State", Axis_Requested_State=8)
    bench.run(0.05)
    assert bench.module.energised


def test_all_messages_that_a_module_sends_unasked_are_decoded():
    bench = Bench()
    enabled(bench, 3, 1)
    bench.run(1.0)
    assert bench.heard
    for frame in bench.heard:
        assert isinstance(decode(frame.can_id, frame.data, from_module=True), DecodedMessage), frame


@pytest.mark.parametrize("remote", [True, False])
@pytest.mark.parametrize("name", [each.name for each in MESSAGES if each.asked is MessageRequestMethod.EMPTY])
def test_every_message_that_can_be_requested_is_answered_and_read(name, remote):
    bench = Bench()
    enabled(bench, 3, 1)
    assert set(asked(bench, name, remote=remote)) == {each.name for each in named(name).answer}


@pytest.mark.parametrize("firmware", [Made(0, 5, 11), Made(0, 5, 12), Made(0, 5, 13)])
def test_the_state_is_read_from_every_layout_of_the_heartbeat(firmware):
    bench = Bench(Module(5, firmware=firmware))
    seen = Heartbeats()
    for state in (1, 8):
        if state == 8:
            enabled(bench, 3, 1)
        since = bench.now
        bench.run(1.0)
        for data in bench.beats(5, since):
            seen = seen.after(5, data)
            assert isinstance(seen, Heartbeats), seen
        beat = beats.read(5, bench.beats(5)[-1])
        assert isinstance(beat, Heartbeat)
        assert (beat.state, beat.axis_error, beat.faults) == (state, 0, ())


def test_the_module_moves_to_a_position_and_reports_its_true_position():
    bench = Bench()
    order(bench, "Set_Traj_Vel_Limit", Traj_Vel_Limit=20.0)
    order(bench, "Set_Traj_Accel_Limits", Traj_Accel_Limit=100.0, Traj_Decel_Limit=100.0)
    enabled(bench, 3, 5)
    order(bench, "Set_Input_Pos", Input_Pos=16.0, Vel_FF=0.0, Torque_FF=0.0)
    bench.run(3.0)
    assert bench.module.position == pytest.approx(16.0, abs=0.02)
    assert asked(bench, "Get_Encoder_Estimates")["Pos_Estimate"] == pytest.approx(
        bench.module.position, abs=1e-3
    )
    assert max(abs(each.velocity) for each in bench.plant) <= 20.0 + 0.5


def test_a_velocity_is_turned_with_and_read_back():
    bench = Bench()
    enabled(bench, 2, 2)
    order(bench, "Set_Input_Vel", Input_Vel=5.0, Torque_FF=0.0)
    bench.run(6.0)  # on the ramp that it has from the factory
    assert bench.module.shaft.speed == pytest.approx(5.0, abs=0.1)
    assert asked(bench, "Get_Encoder_Estimates")["Vel_Estimate"] == pytest.approx(5.0, abs=0.1)
    order(bench, "Set_Axis_State", Axis_Requested_State=1)
    bench.run(0.05)
    assert not bench.module.energised


def test_an_emergency_stop_is_reported_by_both_error_words():
    bench = Bench()
    enabled(bench, 3, 1)
    order(bench, "Estop")
    bench.run(0.3)
    assert not bench.module.energised
    beat = beats.read(5, bench.beats(5)[-1])
    assert isinstance(beat, Heartbeat)
    assert beat.axis_error
    order(bench, "Clear_Errors")
    bench.run(0.3)
    beat = beats.read(5, bench.beats(5)[-1])
    assert isinstance(beat, Heartbeat)
    assert beat.axis_error == 0


@pytest.mark.parametrize("which", list(ErrorType))
def test_every_error_word_can_be_requested_and_is_answered(which):
    bench = Bench()
    (answer,) = give(bench, error_query.request(5, which))
    assert error_query.read(5, answer.data, which) == 0


def test_mit_control_moves_the_output_to_the_commanded_position():
    bench = Bench()
    enabled(bench, 3, 9)
    packed = mit.pack(5, mit.MitCommand(position=1.0, velocity=0.0, kp=60.0, kd=2.0, torque=0.0))
    feedback = None
    for _ in range(2000):
        (answer,) = give(bench, packed.frame)
        feedback = mit.read(5, answer.data)
        bench.run(0.001)
    assert isinstance(feedback, mit.MitFeedback)
    output = bench.module.position / GEAR * 2 * 3.141592653589793
    assert feedback.position == pytest.approx(output, abs=0.01)
    assert output == pytest.approx(1.0, abs=0.1)


def test_a_parameter_is_written_by_the_list_that_the_module_has():
    bench = Bench(Module(5, firmware=Made(0, 6, 0)))
    versions = [give(bench, frame) for frame in endpoint_messages.request_version(5)]
    numbers = []
    for (frame,) in versions:
        found = endpoint_messages.answer(frame.can_id, frame.data)
        numbers.append(struct.unpack_from("<I", found.data)[0] & 0xFF)
    reported = Firmware(*numbers)
    assert str(reported) == "0.6.0"
    listed = FittedList(
        parse(json.dumps(bench.module.json()), "the module's"), Firmware.parse("0.6.0"), reported
    )
    path = "axis0.controller.config.vel_limit"
    give(bench, endpoint_messages.write(5, listed, path, 12.0))
    assert bench.module.usb_read(path) == 12.0
