"""The emulation of CAN Simple frames by the registers of a module, in virtual time: which requests are sent, in which order."""

from __future__ import annotations

import itertools
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.drives.gim6010.can_simple import error_query
from axisbus.drives.gim6010.can_simple.codec import encode
from axisbus.drives.gim6010.can_simple.endpoint_messages import request_version
from axisbus.drives.gim6010.can_simple.error_query import ErrorType
from axisbus.drives.gim6010.can_simple.messages import named as message_named
from axisbus.drives.gim6010.can_simple.orders import TRAPEZOID, VELOCITY
from axisbus.drives.gim6010.modbus.can_emulation import Relay
from axisbus.drives.gim6010.sim.modbus.station import Station
from axisbus.errors import ArgumentError, AxisbusError, DriveError
from kit.modbus.relay_line import ORDERS, SETTINGS, STATE, RelayLine
from kit.modbus.virtual_wire import VirtualWire, list_of

CONTROL, INPUT, POSITION, VELOCITY_SET, ESTOP = 0x64, 0x65, 0x66, 0x68, 0x61


def test_the_relay_polls_state_and_position_and_in_closed_loop_the_estimates():
    line = RelayLine()
    line.plant.motor.position = 0.25 * 16384
    line.work(20)
    assert line.hearing.beat.state == 1
    assert not line.hearing.faulty
    assert line.hearing.place.shown == pytest.approx(0.25 * 16384, abs=2)
    assert line.hearing.missed == line.hearing.bootups == 0
    line.enable()
    assert line.hearing.closed
    assert line.hearing.place.joined
    assert line.hearing.place.velocity == pytest.approx(0.0, abs=0.01)


def test_a_module_is_enabled_and_moved_and_stopped():
    line = RelayLine()
    line.enable()
    assert line.states == [8]
    line.give(*ORDERS.profile(5.0, 20.0, 20.0), ORDERS.position(2.0))
    line.settle()
    line.until(2.0)
    assert line.plant.motor.position / 16384 == pytest.approx(2.0, abs=0.01)
    line.give(ORDERS.idle())
    line.settle()
    assert (line.states, line.plant.energised) == ([8, 1], False)


def test_a_stop_is_sent_before_all_that_waits_and_removes_it():
    line = RelayLine()
    line.enable()
    line.station.frames.clear()
    line.give(*ORDERS.profile(5.0, 20.0, 20.0), ORDERS.position(9.0), *ORDERS.brake(), ORDERS.idle())
    line.settle()
    addresses = [address for address, _ in line.written]
    assert POSITION not in addresses
    assert addresses[:4] == [VELOCITY_SET, CONTROL, INPUT, 0x6A]
    assert addresses[-1] == STATE
    assert not line.plant.energised


def test_the_same_stop_given_time_and_again_waits_once():
    line = RelayLine()
    line.enable()
    line.station.frames.clear()
    for _ in range(30):
        line.give(ORDERS.idle())
    line.settle()
    assert line.states == [1]


def test_closed_loop_is_not_commanded_to_a_module_that_is_in_it():
    line = RelayLine()
    line.enable()
    line.give(ORDERS.closed_loop(), ORDERS.closed_loop())
    line.settle()
    assert line.states == [8]


def test_modes_are_not_changed_under_power():
    line = RelayLine()
    line.enable()
    line.give(ORDERS.mode(TRAPEZOID))
    line.settle()  # they are these already
    line.give(ORDERS.mode((3, 3)))
    with pytest.raises(DriveError, match="under power"):
        line.settle()
    assert line.plant.usb_read("axis0.controller.config.input_mode") == 5


def test_a_brake_under_power_is_written_in_an_order_in_which_each_step_brakes():
    line = RelayLine()
    line.enable()
    line.station.frames.clear()
    line.give(ORDERS.mode(VELOCITY), ORDERS.velocity(0.0))
    line.settle()
    assert [address for address, _ in line.written][:4] == [VELOCITY_SET, CONTROL, INPUT, 0x6A]


def test_a_value_that_the_module_does_not_hold_is_an_error():
    line = RelayLine(clamps={0x70: 3.0})
    line.give(*ORDERS.profile(5.0, 20.0, 20.0), ORDERS.position(1.0))
    with pytest.raises(DriveError, match="trajectory_velocity holds 3"):
        line.settle()


@pytest.mark.parametrize("silent", [1, 2])
def test_values_whose_answers_are_lost_are_read_back_or_written_again(silent):
    line = RelayLine()
    line.enable()
    line.station.dials.silent = silent
    line.give(ORDERS.position(1.5))
    line.settle()
    line.until(1.0)
    assert line.plant.usb_read("axis0.controller.input_pos") == pytest.approx(1.5)


def test_a_silent_line_drops_waiting_orders_but_no_stop():
    line = RelayLine()
    line.enable()
    line.station.dials.deaf = -1
    line.give(*ORDERS.profile(5.0, 20.0, 20.0), ORDERS.position(1.5))
    line.work()
    assert line.relay.is_idle
    line.give(ORDERS.idle())
    line.work()
    line.station.dials.deaf = 0
    line.give(ORDERS.idle())
    line.settle()
    assert not line.plant.energised
    assert line.plant.usb_read("axis0.controller.input_pos") == pytest.approx(0.0, abs=0.01)


def test_a_lost_answer_loses_no_command():
    line = RelayLine()
    line.enable()
    line.station.dials.silent = 1
    line.work()  # the orders given to it are lost
    line.give(ORDERS.position(1.5))
    line.settle()
    assert line.plant.usb_read("axis0.controller.input_pos") == pytest.approx(1.5)


def test_after_a_refused_order_only_a_stop_is_sent_of_those_behind_it():
    line = RelayLine(clamps={0x70: 3.0})
    line.enable()
    line.give(*ORDERS.profile(5.0, 20.0, 20.0), ORDERS.position(1.0))
    with pytest.raises(DriveError):
        line.settle()
    assert line.relay.is_idle
    line.give(ORDERS.idle())
    line.settle()
    assert not line.plant.energised


def test_a_silence_is_no_heartbeat_and_an_answer_after_a_long_one_is_a_restart():
    line = RelayLine()
    line.until(0.5)
    line.station.dials.deaf = -1
    line.until(2.0)
    assert line.hearing.overdue(line.wire.time)
    line.station.dials.deaf = 0
    line.until(2.0)
    assert not line.hearing.overdue(line.wire.time)
    assert line.hearing.bootups == 1


def test_errors_are_reported_by_part_and_by_word():
    line = RelayLine()
    line.work(4)
    line.plant.axis.encoder_error = 0x10
    line.work(4)
    assert "encoder" in line.hearing.beat.faults
    line.give(error_query.request(1, ErrorType.ENCODER))
    line.work()
    assert error_query.read(1, line.told[-1][1], ErrorType.ENCODER) == 0x10
    line.give(ORDERS.clear())
    line.settle()
    line.work(4)
    assert not line.hearing.faulty


def test_endpoints_are_read_and_never_written():
    line = RelayLine()
    line.work(4)
    line.give(*request_version(1))
    line.work(8)
    answers = [data[4] for can_id, data in line.told if can_id == 0x24]
    assert answers == [0, 5, 13]
    line.station.frames.clear()
    write = bytes([1]) + (0x1234).to_bytes(2, "little") + bytes(5)
    line.relay.take(0x24, write, False)
    line.work(4)
    assert 0xA2 not in [address for address, _ in line.written]


def test_a_list_that_does_not_fit_is_an_error():
    station = Station()
    wire = VirtualWire(station)
    listed, _ = list_of(station)
    relay = Relay(wire, {1: (listed, type(list_of(station)[1])(0, 5, 11))})
    relay.work()
    with pytest.raises(ArgumentError):
        relay.work()


def test_a_module_that_is_not_there_leaves_the_line_to_the_others():
    first, second = Station(1), Station(2)
    second.dials.deaf = -1
    wire = VirtualWire(first, second, timeout=0.1)
    relay = Relay(wire, {1: list_of(first), 2: list_of(second)})
    beats, last, longest = 0, 0.0, 0.0
    while wire.time < 10.0:
        for can_id, _ in relay.work():
            if can_id == 0x21:
                beats, longest, last = beats + 1, max(longest, wire.time - last), wire.time
    assert beats > 100
    assert longest < 3 * SETTINGS.heartbeat


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.integers(0x20, 0x3F), st.binary(max_size=8), st.booleans()), max_size=12))
def test_random_frames_request_no_state_but_idle_and_closed_loop(frames):
    line = RelayLine()
    for can_id, data, remote in frames:
        line.relay.take(can_id, data, remote)
    with suppress(AxisbusError):  # an invalid value
        line.settle()
    assert set(line.states) <= {1, 8}
    written = {address for address, _ in line.written}
    assert not written & {0x62, 0x7E, 0x80, 0xA2}  # neither node ID, restart, save, nor a parameter


def test_set_points_of_a_ramp_replace_each_other_and_alternate_with_readings():
    line = RelayLine()
    line.give(ORDERS.mode(VELOCITY), ORDERS.closed_loop())
    line.settle()
    line.until(0.5)
    line.station.frames.clear()
    line.station.dials.delay = 0.02  # an adapter that holds its bytes
    beats = []
    for number in range(50):
        line.give(ORDERS.velocity(0.1 * number))
        until = line.wire.time + 0.02
        while line.wire.time < until:
            line.work()
            beats.append(line.hearing.beat_at)
    line.settle()
    sent = [data for address, data in line.written if address == VELOCITY_SET]
    assert 5 < len(sent) < 40
    assert line.plant.usb_read("axis0.controller.input_vel") == pytest.approx(4.9)
    assert max(b - a for a, b in itertools.pairwise(beats)) < SETTINGS.heartbeat


def test_a_stop_after_a_set_point_is_sent_before_the_next_reading_although_the_same_stop_was_confirmed_before():
    line = RelayLine()
    for order in (ORDERS.mode(VELOCITY), ORDERS.idle(), ORDERS.closed_loop()):
        line.give(order)
        line.settle()
    line.station.frames.clear()
    line.give(ORDERS.velocity(1.0))
    while not line.written:
        line.work()
    line.give(ORDERS.idle())
    line.work()
    assert [address for address, _ in line.written] == [VELOCITY_SET, STATE]


def test_a_calibration_is_passed_on_only_if_the_owner_of_the_line_asks_for_it():
    wanted = encode(1, message_named("Set_Axis_State"), {"Axis_Requested_State": 7})
    line = RelayLine()
    line.give(wanted)
    line.settle()
    assert line.states == []
    line = RelayLine(calibrates=True)
    line.give(wanted, wanted)
    line.settle()
    assert line.states == [7]  # once, in idle only


def test_a_module_whose_address_is_no_node_id_of_can_simple_gets_another_one_on_the_channel():
    station = Station(1)
    relay = Relay(VirtualWire(station), {63: None}, devices={63: 1})
    heard = [can_id >> 5 for _ in range(4) for can_id, _ in relay.work()]
    assert set(heard) == {63}
    assert {frame[0] for frame in station.frames} == {1}


def test_without_a_list_the_position_of_an_idle_module_is_not_sent():
    line = RelayLine(listed=False)
    line.work(10)
    assert {can_id & 0x1F for can_id, _ in line.told} == {1}
    line.enable()
    assert line.hearing.place.joined
