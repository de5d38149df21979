"""The simulated drive on RS485, by bytes alone: the frames of the manual (v2.2, 4.3), and its fault settings."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.drives.gim6010.sim.modbus.station import Frames, Station, StationFaults, checksum, framed
from axisbus.drives.gim6010.sim.module import Module


class Line:
    """A station that is spoken to in hex, without checksums."""

    def __init__(self, station=None, **dials):
        self.station = station or Station(dials=StationFaults(**dials))
        self.time = 0.0

    def ask(self, text, wait=0.01):
        self.station.take(framed(bytes.fromhex(text)), self.time)
        self.wait(wait)
        data = self.station.due(self.time)
        assert not data or checksum(data[:-2]) == data[-2:]
        return data[:-2].hex(" ").upper()

    def wait(self, seconds):
        self.time += seconds
        self.station.step(self.time)

    def number(self, address, function="04"):
        return struct.unpack(">f", bytes.fromhex(self.ask(f"01 {function} {address} 00 02")[9:]))[0]


def test_the_checksum_is_that_of_the_standard():
    # Modbus over serial line V1.02, appendix B: 02 07 -> 41 12, the low byte first.
    assert checksum(bytes.fromhex("02 07")) == bytes.fromhex("41 12")


@given(st.lists(st.binary(min_size=0, max_size=6), min_size=1, max_size=4), st.data())
def test_modbus_frames_are_separated_for_any_split_of_their_bytes(values, data):
    sent = [
        bytes([1, 0x10, 0, 0x66, 0, len(value) // 2, len(value) & 0xFE]) + value[: len(value) & 0xFE]
        for value in values
    ]
    stream = b"".join(map(framed, sent))
    frames, found, time = Frames(), [], 0.0
    while stream:
        size = data.draw(st.integers(1, len(stream)))
        found += frames.take(stream[:size], time)
        stream, time = stream[size:], time + 0.001
    assert found == sent


def test_a_broken_frame_is_dropped_and_silence_begins_again():
    frames = Frames()
    good = framed(bytes.fromhex("01 04 00 01 00 01"))
    assert frames.take(good[:-1] + b"\x00", 0.0) == []
    assert frames.broken == 1
    assert frames.take(good[:3], 1.0) == []
    assert frames.take(good, 1.1) == [good[:-2]]  # the bytes before the silence are no part of it


def test_the_example_of_velocity_control():
    line = Line()
    line.station.module.usb_write("axis0.controller.config.vel_ramp_rate", 20.0)
    for frame in ("01 06 00 64 00 02", "01 06 00 65 00 02", "01 06 00 63 00 08"):
        assert line.ask(frame) == frame
    assert line.ask("01 04 00 01 00 01") == "01 04 02 00 08"
    assert line.ask("01 10 00 68 00 02 04 40 13 33 33") == "01 10 00 68 00 02"
    line.wait(1.0)
    assert line.number("00 11") == pytest.approx(2.3, rel=1e-3)
    assert line.ask("01 03 00 68 00 02") == "01 03 04 40 13 33 33"


def test_the_wrong_example_of_position_control_does_not_move_to_the_position():
    line = Line()
    for frame in ("01 06 00 64 00 03", "01 06 00 65 00 03", "01 06 00 63 00 08"):
        assert line.ask(frame) == frame
    line.ask("01 10 00 68 00 02 04 40 49 0F F9")  # as the manual prints it: the velocity
    line.wait(6.0)
    assert line.number("00 66", "03") == 0.0  # the set-point of the position is as it was
    line.ask("01 10 00 68 00 02 04 00 00 00 00")
    line.ask("01 10 00 66 00 02 04 40 49 0F F9")
    line.wait(6.0)
    assert line.number("00 0F") == pytest.approx(3.1416, abs=1e-3)


@pytest.mark.parametrize(
    ("frame", "code"),
    [
        ("01 04 00 03 00 01", "84 02"),  # one of two
        ("01 04 00 06 00 03", "84 02"),
        ("01 04 00 0F 00 04", "84 02"),  # two values
        ("01 03 00 67 00 02", "83 02"),
        ("01 03 00 01 00 01", "83 02"),  # an input register is no holding register
        ("01 06 00 66 00 01", "86 02"),  # half a value
        ("01 10 00 66 00 01 02 00 00", "90 02"),
        ("01 10 00 66 00 02 02 00 00", "90 03"),
        ("01 06 00 63 00 05", "86 03"),
        ("01 2B 0E 01 00", "AB 01"),
    ],
)
def test_requests_that_the_module_refuses(frame, code):
    line = Line()
    assert line.ask(frame) == f"01 {code}"
    assert line.station.module.energised is False


def test_a_module_obeys_its_own_address_and_without_an_answer_the_broadcast_address():
    line = Line()
    assert line.ask("02 04 00 01 00 01") == ""
    assert line.ask("00 06 00 64 00 02") == ""
    assert line.ask("01 03 00 64 00 01") == "01 03 02 00 02"


def test_emergency_stop_latches_until_it_is_cleared():
    line = Line()
    line.ask("01 06 00 63 00 08")
    assert line.ask("01 06 00 61 12 34") == "01 06 00 61 12 34"
    assert line.ask("01 04 00 01 00 01") == "01 04 02 00 01"
    assert line.ask("01 04 00 02 00 01") == "01 04 02 00 10"
    assert line.ask("01 04 00 03 00 02") == "01 04 04 00 00 40 00"
    line.ask("01 06 00 63 00 08")
    assert line.ask("01 04 00 01 00 01") == "01 04 02 00 01"
    line.ask("01 06 00 7F 00 00")
    assert line.ask("01 04 00 02 00 01") == "01 04 02 00 00"


def test_position_is_dead_in_idle_unless_it_is_reported_otherwise():
    line = Line()
    line.station.module.motor.position = 5 * 16384
    assert line.number("00 0F") == 0.0
    line.station.dials.dead_in_idle = False
    assert line.number("00 0F") == pytest.approx(5.0, abs=1e-3)


def test_endpoints_are_read_and_written_by_their_number():
    line = Line()
    number = line.station.module.endpoints.number("axis0.controller.config.vel_limit")
    assert line.ask(f"01 06 00 A1 {number:04X}") == f"01 06 00 A1 {number >> 8:02X} {number & 0xFF:02X}"
    assert line.ask("01 04 00 31 00 02") == "01 04 04 41 F0 00 00"
    assert line.ask("01 10 00 A2 00 02 04 41 20 00 00") == "01 10 00 A2 00 02"
    assert line.station.module.usb_read("axis0.controller.config.vel_limit") == 10.0


def test_saving_restarts_and_a_new_node_id_holds():
    line = Line()
    assert line.ask("01 06 00 62 00 05") == "01 06 00 62 00 05"
    assert line.ask("01 04 00 01 00 01") == ""
    line.ask("05 06 00 80 00 01")
    assert line.station.module.restarts == 1
    assert line.ask("05 04 00 01 00 01") == ""  # it restarts
    line.wait(2.0)
    assert line.ask("05 04 00 01 00 01") == "05 04 02 00 01"
    later = Line(node_id_at_once=False)
    later.ask("01 06 00 62 00 05")
    assert later.ask("01 03 00 62 00 01") == "01 03 02 00 05"
    later.ask("01 06 00 80 00 01")
    later.wait(2.0)
    assert later.ask("05 03 00 62 00 01") == "05 03 02 00 05"


def test_without_saving_the_old_node_id_is_restored():
    line = Line()
    line.ask("01 06 00 62 00 05")
    line.ask("05 06 00 7E 00 01")
    line.wait(2.0)
    assert line.ask("01 03 00 62 00 01") == "01 03 02 00 01"


def test_faults_of_the_line():
    line = Line(silent=1)
    assert line.ask("01 06 00 64 00 02") == ""  # obeyed, and not answered
    assert line.ask("01 03 00 64 00 01") == "01 03 02 00 02"
    line.station.dials.deaf = 1
    assert line.ask("01 06 00 64 00 01") == ""
    assert line.ask("01 03 00 64 00 01") == "01 03 02 00 02"
    line.station.dials.delay = 0.05
    assert line.ask("01 03 00 64 00 01") == ""
    line.wait(0.05)
    assert line.station.due(line.time)[:-2] == bytes.fromhex("01 03 02 00 02")
    line.station.dials.delay = 0.0
    line.station.dials.exceptions[0x64, False] = 6
    assert line.ask("01 03 00 64 00 01") == "01 83 06"
    line.station.dials.exceptions.clear()
    line.station.dials.wrong_checksum = 1
    line.station.take(framed(bytes.fromhex("01 03 00 64 00 01")), line.time)
    data = line.station.due(line.time)
    assert checksum(data[:-2]) != data[-2:]


def test_a_module_on_rs485_sends_nothing_on_can():
    station = Station(module=Module(1, comm_intf_mux=1))
    station.step(0.0)
    station.step(1.0)
    assert station.module.take_frames() == []


@given(st.binary(max_size=300))
def test_no_frame_raises_and_only_a_request_enables(data):
    station = Station()
    station.take(data, 0.0)
    station.take(framed(data), 1.0)
    assert not station.module.energised or b"\x06\x00\x63\x00\x08" in data
