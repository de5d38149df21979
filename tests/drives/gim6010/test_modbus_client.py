"""Questions over Modbus: lost, late, broken and refused answers, and that no value is ever taken for another one."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.dialogue import QUIET, ModbusClient, ModbusRefused
from axisbus.drives.gim6010.modbus.registers import REGISTERS, named
from axisbus.drives.gim6010.modbus.requests import ModbusTimeout, Reply
from axisbus.drives.gim6010.sim.modbus.station import Station, StationFaults
from axisbus.errors import ArgumentError, NodeTimeout
from kit.modbus.virtual_wire import VirtualWire


def line(device=1, **dials):
    station = Station(dials=StationFaults(**dials))
    wire = VirtualWire(station)
    return station, wire, ModbusClient(wire, device)


def read(name):
    return requests.read(named(name))


@pytest.mark.parametrize("device", [-1, 0, 248])
def test_an_invalid_address_is_refused(device):
    with pytest.raises(ArgumentError, match="not an address of a module"):
        line(device)


def test_an_answer_is_had_at_once_with_one_frame():
    station, wire, dialogue = line()
    assert dialogue.read(read("node_id")) == (1,)
    assert [frame.hex(" ") for frame in station.frames] == ["01 03 00 62 00 01"]
    assert wire.time < 0.01


@pytest.mark.parametrize("fault", ["silent", "deaf", "wrong_checksum", "short"])
def test_a_read_without_a_valid_answer_is_repeated(fault):
    station, _, dialogue = line(**{fault: 1})
    assert dialogue.read(read("bus_voltage")) == (0x41C0, 0)
    assert len(station.frames) == 3  # the question, the probe of another shape, the question


@pytest.mark.parametrize("fault", ["silent", "deaf"])
def test_a_dead_line_is_reported_with_the_checks(fault):
    station, wire, dialogue = line(**{fault: -1})
    with pytest.raises(NodeTimeout) as caught:
        dialogue.read(read("bus_voltage"))
    assert "does not answer for bus_voltage" in caught.value.message
    assert "01 04 00 13 00 02" in caught.value.observed
    for word in ("supply", "A and B", "bit rate", "node ID", "comm_intf_mux"):
        assert word in caught.value.remedy
    assert wire.time < 4.0
    assert len(station.frames) <= 9


def test_an_exception_is_reported_and_the_request_not_repeated():
    station, _, dialogue = line(exceptions={(0x13, False): 2})
    with pytest.raises(ModbusRefused, match="refuses the request: bus_voltage") as caught:
        dialogue.read(read("bus_voltage"))
    assert caught.value.code == 2
    assert "no such register" in caught.value.observed
    assert len(station.frames) == 1


def test_a_write_is_sent_once_for_any_failure():
    for dials in ({"silent": 1}, {"deaf": 1}, {"wrong_checksum": 1}):
        station, _, dialogue = line(**dials)
        assert dialogue.write(requests.write(named("state_control"), 8)) is False
        assert len(station.frames) == 1


def test_a_late_answer_is_not_accepted_for_the_next_request():
    station, wire, dialogue = line(late={0: 0.25})
    station.module.usb_write("axis0.controller.config.pos_gain", 7.0)
    assert dialogue.write(requests.write(named("velocity_limit"), 12.0)) is False
    assert dialogue.read(read("position_gain")) == (0x40E0, 0)
    assert wire.time > 0.2 + QUIET


class Numbered:
    """A wire whose every answer contains the number of its request; each answer is delayed by the given time. Some are lost."""

    timeout = 0.2

    def __init__(self, delays):
        self.delays = iter(delays)
        self.time = 0.0
        self.coming: list[tuple[float, Reply]] = []
        self.sent: list[requests.ModbusRequest] = []

    def exchange(self, device, request):
        self._forget()
        delay = next(self.delays, 0.01)
        number = len(self.sent)
        self.sent.append(request)
        if delay is not None:
            # a module answers in order: none overtakes the one before
            due = max([self.time + delay, *(time for time, _ in self.coming)])
            words = (number,) * request.count
            self.coming.append((due, Reply(request.function, words, request.address, request.count)))
        end = self.time + self.timeout
        if not self.coming or self.coming[0][0] > end:
            self.time = end
            raise ModbusTimeout
        self.time = max(self.time, self.coming[0][0])
        return self.coming.pop(0)[1]

    def drain(self, seconds):
        self.time += seconds
        self._forget()

    def _forget(self):
        self.coming = [each for each in self.coming if each[0] > self.time]

    def now(self):
        return self.time

    def sleep(self, seconds):
        self.time += seconds

    def close(self):
        pass


READABLE = [each for each in REGISTERS if each.readable]
LATEST = 0.2 + QUIET - 0.001


@settings(max_examples=300)
@given(
    st.lists(st.sampled_from(READABLE), min_size=1, max_size=6),
    st.lists(st.none() | st.floats(0.001, LATEST), max_size=12),
)
def test_no_value_is_another_one_s_or_older_than_its_question(registers, delays):
    wire = Numbered(delays)
    dialogue = ModbusClient(wire, 1)
    for register in registers:
        before = len(wire.sent)
        try:
            words = dialogue.read(requests.read(register))
        except NodeTimeout:
            continue
        assert words[0] >= before, "an answer from before the question"
        assert wire.sent[words[0]].register is register


@settings(max_examples=100)
@given(st.lists(st.none() | st.floats(0.001, LATEST), min_size=1, max_size=8))
def test_after_an_unanswered_urgent_write_no_old_frame_is_mistaken_for_an_answer(delays):
    wire = Numbered(delays)
    dialogue = ModbusClient(wire, 1)
    request = requests.write(named("control_mode"), 2)
    dialogue.shout(request)
    before = len(wire.sent)
    try:
        words = dialogue.read(read("control_mode"))
    except NodeTimeout:
        return
    assert words[0] >= before
    assert wire.sent[words[0]].register is named("control_mode")


def test_a_late_answer_during_a_probe_is_not_mistaken_for_its_answer():
    wire = Numbered([0.6, 0.15])
    words = ModbusClient(wire, 1).read(read("error_flags"))
    assert wire.sent[words[0]].register is named("error_flags")
    assert words[0] > 0


def test_a_shout_that_is_refused_returns_false():
    _, _, dialogue = line(exceptions={(0x64, True): 4})
    assert dialogue.shout(requests.write(named("control_mode"), 2)) is False
    assert dialogue.shout(requests.write(named("input_mode"), 2)) is True


def test_an_urgent_write_does_not_wait_for_owed_answers():
    station, wire, dialogue = line(silent=1)
    dialogue.write(requests.write(named("velocity_limit"), 12.0))
    begin = wire.time
    assert dialogue.shout(requests.write(named("state_control"), 1)) is True
    assert wire.time - begin < 0.05
    assert station.frames[-1] == bytes.fromhex("01 06 00 63 00 01")


def test_an_answer_to_an_interrupted_request_is_not_accepted_later():
    station, wire, dialogue = line()

    def torn(request):
        wire.before = lambda _: None
        station.take(bytes.fromhex("01 04 00 13 00 02 D0 0E")[:-2], wire.time)  # half a frame is on the wire
        raise KeyboardInterrupt

    wire.before = torn
    with pytest.raises(KeyboardInterrupt):
        dialogue.read(read("bus_voltage"))
    assert dialogue.read(read("velocity_limit")) == (0x41F0, 0)
