"""A calibration over the relay of a module on RS485, in virtual time: followed, judged, and ended by whatever comes between."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.calibration import Calibration, CalibrationKind
from axisbus.drives.gim6010.modbus.module import Present, present
from axisbus.errors import AxisbusError
from kit.modbus.relay_line import RelayLine
from kit.modbus.rig import Rig

ESTOP = 0x61


class Calibrated(RelayLine):
    """A line with a calibration of its module."""

    def __init__(self, kind=CalibrationKind.FULL, **dials):
        super().__init__(calibrates=True, **dials)
        self.guards = True
        self.calibration = Calibration(1, kind, guarded=lambda: self.guards)
        self.failed = False

    def run(self, at=None, longest=60.0):
        """Run it to its end, as ``bus.run`` does; ``at``: called before each step with the time since the start."""
        start = self.wire.time
        while not self.calibration.done:
            assert self.wire.time - start < longest
            if at is not None:
                at(self.wire.time - start)
            frame = self.calibration.step(self.wire.time)
            if frame is not None:
                self.give(frame)
            self._work()
        return self.calibration

    def _work(self):
        if self.failed and self.relay.is_idle:
            self.wire.sleep(0.01)
            return
        try:
            told = self.relay.work()
        except AxisbusError:
            self.failed = True
            return
        for can_id, data in told if not self.failed else ():
            self.calibration.note(CanFrame(self.wire.time, can_id, data))

    @property
    def is_off(self):
        return not self.plant.energised


def once(moment, act):
    """Do something once, so many seconds after the start."""
    done = []

    def look(now):
        if now >= moment and not done:
            done.append(True)
            act()

    return look


@pytest.mark.parametrize("delay", [0.0, 0.02])
@pytest.mark.parametrize("kind", CalibrationKind)
def test_a_calibration_runs_to_its_end_and_is_judged(kind, delay):
    line = Calibrated(kind, delay=delay)
    found = line.run()
    assert found.verdict is not None, found.why
    assert found.verdict.good, found.verdict
    assert line.states == [kind.value]
    assert line.is_off
    assert found.turned.heard > 10
    assert found.turned.high == pytest.approx(1.0 if kind.turns else 0.0, abs=0.1)


def test_a_module_that_is_enabled_or_has_errors_is_not_calibrated():
    line = Calibrated()
    line.plant.usb_write("axis0.requested_state", 8)
    line.wire.sleep(0.2)
    assert "closed loop" in line.run().why
    assert line.states == []
    line = Calibrated()
    line.plant.axis.encoder_error = 0x10
    assert "encoder" in line.run().why.lower()
    assert line.states == []


def test_errors_during_a_calibration_are_reported():
    line = Calibrated(CalibrationKind.MOTOR)
    found = line.run(once(2.0, lambda: setattr(line.plant.axis, "motor_error", 0x1)))
    assert found.verdict is not None
    assert not found.verdict.good
    assert any("motor" in text for text in found.verdict.wrong)


def test_an_interrupt_before_the_first_request_ends_the_calibration_at_once():
    line = Calibrated()
    found = line.run(once(0.5, lambda: line.calibration.interrupt("Ctrl-C")))
    assert (line.states, found.why) == ([], "Ctrl-C")
    assert "nothing was sent" in found.left


@settings(max_examples=12, deadline=None)
@given(st.floats(1.6, 12.0), st.integers(1, 2))
def test_an_interrupt_at_any_moment_takes_the_power_away(moment, times):
    line = Calibrated()

    def interrupt():
        for _ in range(times):
            line.calibration.interrupt("Ctrl-C")

    found = line.run(once(moment, interrupt))
    assert line.is_off
    assert found.confirmed
    assert line.states.count(CalibrationKind.FULL.value) <= 1


@pytest.mark.parametrize("moment", [2.0, 6.0])
def test_a_watchdog_process_that_ends_stops_the_calibration(moment):
    line = Calibrated()
    found = line.run(once(moment, lambda: setattr(line, "guards", False)))
    assert "watchdog process has ended" in found.why
    assert line.is_off


def test_a_rotor_that_turns_too_far_ends_it():
    line = Calibrated(CalibrationKind.MOTOR)
    turned = line.calibration.turned
    found = line.run(once(2.0, lambda: [turned.take((turned._count + 6000) % 16384) for _ in range(4)]))
    assert "farther than a calibration may turn it" in found.why
    assert line.is_off


@pytest.mark.parametrize("moment", [2.0, 6.0])
def test_a_state_that_does_not_belong_to_a_calibration_ends_it(moment):
    line = Calibrated()
    found = line.run(once(moment, lambda: line.plant.usb_write("axis0.requested_state", 8)))
    assert "closed loop" in found.why
    assert line.is_off


def test_a_calibration_that_does_not_begin_is_reported_and_not_requested_again():
    line = Calibrated()

    def lose(request):
        if request.writes and request.address == 0x63 and request.words == (3,):
            line.station.dials.deaf = 1

    line.wire.before = lose
    found = line.run()
    assert "does not begin" in found.why
    assert line.states[0] == 3
    assert set(line.states[1:]) == {1}
    assert line.is_off


@pytest.mark.parametrize("dial", ["deaf", "silent"])
@pytest.mark.parametrize("moment", [2.0, 6.0])
def test_a_line_that_falls_silent_ends_it_and_is_reported_as_not_confirmed(dial, moment):
    line = Calibrated()
    found = line.run(once(moment, lambda: setattr(line.station.dials, dial, -1)))
    assert "no longer heard" in found.why
    assert "NOT CONFIRMED" in found.left
    assert not found.confirmed
    assert line.is_off or dial == "deaf"
    assert dial == "deaf" or ESTOP in [address for address, _ in line.written]


def test_modules_on_the_line_are_found_without_a_write():
    rig = Rig()
    found = list(present(rig.wire, range(1, 4)))
    assert found[1:] == [2, 3]
    one = found[0]
    assert isinstance(one, Present)
    assert (one.device, one.state, one.trouble) == (1, 1, "")
    assert "idle" in str(one)
    assert rig.written == []
    rig.plant.axis.encoder_error = 0x10
    assert "encoder" in str(next(present(rig.wire, [1])))


def test_a_module_that_only_answers_with_exceptions_counts_as_present():
    rig = Rig(exceptions={(0x01, False): 4})
    (found,) = present(rig.wire, [1])
    assert isinstance(found, Present)
    assert "refuses" in found.trouble
