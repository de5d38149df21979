"""The stop of a module on RS485 outside a scan, in virtual time: whoever enabled it, whatever is lost, and what is reported."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.port.stop_without_scan import ModuleRescue, RescueStep
from axisbus.errors import AxisbusError
from kit.modbus.relay_line import SETTINGS, STATE, RelayLine

CONTROL, INPUT, VELOCITY_SET, TORQUE_SET, ESTOP = 0x64, 0x65, 0x68, 0x6A, 0x61
MODES = {"position": (3, 5), "velocity": (2, 2), "torque": (1, 6)}
POLL = 0.005


class Stopped(RelayLine):
    """A line whose module another program has enabled, and the stop of this program on it."""

    def __init__(self, control="velocity", *, listed=True, ramp=40.0, **dials):
        super().__init__(listed=listed, **dials)
        self._write("config.vel_ramp_rate", ramp)
        self._write("config.torque_ramp_rate", 5.0)
        if control:
            self.begin(control)
        self.rescue = ModuleRescue(SETTINGS, counts=listed, longest=6.0 if listed else 30.0)
        self.failed = False
        self.station.frames.clear()

    def _write(self, path, value):
        self.plant.usb_write(f"axis0.controller.{path}", value)

    def begin(self, control):
        """Let another program move it."""
        mode, inputs = MODES[control]
        self._write("config.control_mode", mode)
        self._write("config.input_mode", inputs)
        self.plant.usb_write("axis0.requested_state", 8)
        self.wire.sleep(0.2)
        self._write(
            *{
                "position": ("input_pos", 300.0),
                "velocity": ("input_vel", 5.0),
                "torque": ("input_torque", 0.1),
            }[control]
        )
        self.wire.sleep(1.0)

    def run(self, at=None, longest=15.0):
        """Stop it as ``stop_modules`` does; return the rescue. ``at``: called before each step with the time since the start."""
        start = self.wire.time
        while not self.rescue.text:
            assert self.wire.time - start < longest
            if at is not None:
                at(self.wire.time - start)
            self.give(*self.rescue.step(self.wire.time))
            until = self.wire.time + POLL
            while self.wire.time < until:
                self._work()
        return self.rescue

    def _work(self):
        """As ``RelayedBus``: after an error nothing is received, and stops are still sent."""
        if self.failed and self.relay.is_idle:
            self.wire.sleep(0.01)
            return
        try:
            told = self.relay.work()
        except AxisbusError:
            self.failed = True
            return
        for can_id, data in told if not self.failed else ():
            self.rescue.receive(CanFrame(self.wire.time, can_id, data), self.wire.time)

    @property
    def is_off(self):
        return not self.plant.energised

    @property
    def speed(self):
        return abs(self.plant.shaft.speed)


@pytest.mark.parametrize("listed", [True, False])
@pytest.mark.parametrize("control", MODES)
def test_a_module_that_another_program_moves_is_braked_and_switched_off(control, listed):
    line = Stopped(control, listed=listed)
    assert line.speed > 0.4
    found = line.run()
    assert (found.ok, found.text) == (True, "stands, without power")
    assert line.is_off
    assert line.speed < 0.02
    writes = [(where, data) for where, data in line.written if where != 0xA1]
    assert [where for where, _ in writes[:4]] == [VELOCITY_SET, CONTROL, INPUT, TORQUE_SET]
    assert [data[-1] for _, data in writes[:4]] == [0, 2, 2, 0]
    assert {int.from_bytes(data, "big") for where, data in writes if where == STATE} == {1}
    assert ESTOP not in [where for where, _ in writes]


def test_a_module_in_idle_is_confirmed_without_its_list_and_nothing_is_written():
    line = Stopped("", listed=False)
    found = line.run()
    assert (found.ok, found.text) == (True, "is in idle, without power, and was not seen in closed loop")
    assert line.written == []


@pytest.mark.parametrize("listed", [True, False])
def test_a_slow_adapter_does_not_prevent_that_standstill_is_seen(listed):
    line = Stopped("velocity", listed=listed)
    line.station.dials.delay = 0.03
    found = line.run()
    assert (found.ok, found.text) == (True, "stands, without power")
    assert line.is_off


@pytest.mark.parametrize("listed", [True, False])
def test_a_slow_ramp_is_waited_for(listed):
    line = Stopped("velocity", listed=listed, ramp=1.0)
    found = line.run()
    assert found.ok
    assert line.speed < 0.02


@pytest.mark.parametrize("state", [4, 7])
def test_a_calibration_is_ended_at_once(state):
    line = Stopped("", listed=False)
    line.plant.usb_write("axis0.requested_state", state)
    line.wire.sleep(0.3)
    assert line.plant.energised
    found = line.run()
    assert found.ok, found.text
    assert line.is_off


@pytest.mark.parametrize("listed", [True, False])
@pytest.mark.parametrize("control", MODES)
def test_if_answers_are_lost_for_good_it_is_stopped_blind_and_reported_as_not_confirmed(control, listed):
    line = Stopped(control, listed=listed)
    line.station.dials.silent = -1
    found = line.run()
    assert not found.ok
    assert found.text.startswith("NOT CONFIRMED as stopped")
    assert line.is_off
    assert {STATE, ESTOP, VELOCITY_SET} <= {where for where, _ in line.written}


def test_a_module_that_is_not_heard_is_reported_as_not_confirmed_in_bounded_time():
    line = Stopped("velocity")
    line.station.dials.deaf = -1
    found = line.run(longest=10.0)
    assert not found.ok
    assert "is not heard" in found.text


def test_a_line_that_is_connected_again_during_the_stop_is_used():
    line = Stopped("velocity")
    line.wire.broken = True
    found = line.run(at=lambda now: setattr(line.wire, "broken", now < 2.5))
    assert line.is_off
    assert found.ok or "NOT" in found.text


@pytest.mark.parametrize("address", [0x01, 0x02, 0x0F, 0x11])
def test_an_exception_code_at_any_reading_does_not_prevent_any_step(address):
    line = Stopped("velocity", listed=False, exceptions={(address, False): 4})
    found = line.run()
    assert line.is_off
    assert not found.ok


@pytest.mark.parametrize("address", [CONTROL, INPUT, VELOCITY_SET, TORQUE_SET, STATE])
def test_a_refused_request_of_the_stop_does_not_prevent_the_next_step(address):
    line = Stopped("velocity", exceptions={(address, True): 3})
    line.run()
    assert line.is_off
    assert address != STATE or ESTOP in [where for where, _ in line.written]


def test_a_module_that_another_program_turns_again_is_switched_off():
    line = Stopped("velocity")
    found = line.run(at=lambda _: line._write("input_vel", 5.0) if line.plant.energised else None)
    assert line.is_off
    assert found.ok or "NOT" in found.text


def test_each_further_signal_starts_the_next_step():
    line = Stopped("velocity", ramp=1.0)
    steps = []

    def hurry(now):
        steps.append(line.rescue.rung)
        if now > 0.5 and line.rescue.rung is RescueStep.BRAKE:
            line.rescue.escalate(line.wire.time)

    line.run(at=hurry)
    assert RescueStep.IDLE in steps
    assert line.is_off


@pytest.mark.parametrize("control", MODES)
@pytest.mark.parametrize("first", range(0, 40, 3))
def test_lost_answers_at_any_request_end_without_power(control, first):
    line = Stopped(control)
    asked = [0]

    def lose(_):
        asked[0] += 1
        if first <= asked[0] < first + 2:
            line.station.dials.silent = 1

    line.wire.before = lose
    found = line.run()
    assert line.is_off
    assert found.ok, found.text


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(list(MODES)),
    st.booleans(),
    st.lists(st.sampled_from(["", "", "", "silent", "deaf", "wrong_checksum", "short"]), max_size=60),
)
def test_a_stop_is_never_confirmed_for_a_module_with_power(control, listed, losses):
    line = Stopped(control, listed=listed)
    left = iter(losses)

    def lose(_):
        name = next(left, "")
        if name:
            setattr(line.station.dials, name, 1)

    line.wire.before = lose
    found = line.run(longest=40.0)
    if found.ok:
        assert line.is_off
        assert line.speed < 0.1
