"""A calibration over Modbus in virtual time against the plant: followed, judged, and ended by whatever comes between."""

from __future__ import annotations

import signal

import pytest

from axisbus.drives.gim6010.calibration import CalibrationKind
from axisbus.drives.gim6010.modbus.module import Present, present
from axisbus.drives.gim6010.modbus.motion.calibrating import Calibrating
from axisbus.drives.gim6010.modbus.parameters import ModbusParameters
from axisbus.errors import CommandError, DriveError, DriveFault, NodeError, StateError
from kit.modbus.rig import Rig
from kit.modbus.virtual_wire import list_of

STATE_CONTROL = "00 63"


class Calibrated(Rig):
    """A rig with a calibration on it."""

    def __init__(self, kind=CalibrationKind.FULL, **dials):
        super().__init__(**dials)
        known = ModbusParameters(self.module)
        known.open(*list_of(self.station))
        self.guards = True
        self.station.frames.clear()
        self.calibration = Calibrating(known, kind, tell=self.said.append, guarded=lambda: self.guards)

    @property
    def asked(self):
        """The values written to the state, in order."""
        return [int(each[-2:], 16) for each in self.written if each.startswith(f"06 {STATE_CONTROL}")]

    def deafen(self, requests):
        self.station.dials.deaf = requests

    @property
    def is_off(self):
        return not self.plant.energised


@pytest.mark.parametrize("kind", CalibrationKind)
def test_a_calibration_runs_to_its_end_and_is_judged(kind):
    rig = Calibrated(kind)
    found = rig.calibration.run()
    assert found.good, found
    assert rig.asked == [kind.value]
    assert rig.is_off
    assert rig.calibration.turned.heard > 10
    assert set(kind.parts) <= set(rig.calibration._seen)


def test_a_module_that_is_enabled_or_has_errors_is_not_calibrated():
    rig = Calibrated()
    rig.plant.usb_write("axis0.requested_state", 8)
    rig.rest(0.2)
    with pytest.raises(StateError, match="only in idle"):
        rig.calibration.run()
    rig = Calibrated()
    rig.plant.axis.encoder_error = 0x10
    with pytest.raises(DriveFault):
        rig.calibration.run()
    assert rig.asked == []


def test_errors_during_a_calibration_are_reported():
    rig = Calibrated(CalibrationKind.MOTOR)
    rig.at(30, lambda _: setattr(rig.plant.axis, "motor_error", 0x1))
    found = rig.calibration.run()
    assert not found.good
    assert any("motor" in text for text in found.wrong)


def test_ctrl_c_before_the_first_request_ends_the_calibration_at_once():
    rig = Calibrated()
    rig.at(4, lambda _: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        rig.calibration.run()
    assert (rig.asked, rig.said) == ([], [])


@pytest.mark.parametrize("number", [12, 25, 60, 100])
def test_ctrl_c_takes_the_power_away(number):
    rig = Calibrated()
    rig.at(number, lambda _: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        rig.calibration.run()
    assert rig.is_off
    assert "in idle, without power" in rig.said[-1]
    assert rig.asked[1:] in ([1], [1, 1], [])


def test_a_watchdog_process_that_ends_stops_the_calibration():
    rig = Calibrated()
    rig.at(40, lambda _: setattr(rig, "guards", False))
    with pytest.raises(CommandError, match="watchdog process of this calibration has ended"):
        rig.calibration.run()
    assert rig.is_off


def test_a_rotor_that_turns_too_far_ends_it():
    rig = Calibrated(CalibrationKind.MOTOR)
    turned = rig.calibration.turned
    rig.at(60, lambda _: [turned.take((turned._count + 6000) % 16384) for _ in range(4)])
    with pytest.raises(DriveError, match="farther than a calibration may turn it"):
        rig.calibration.run()
    assert rig.is_off


def test_a_state_that_does_not_belong_to_a_calibration_ends_it():
    rig = Calibrated()
    rig.at(60, lambda _: rig.plant.usb_write("axis0.requested_state", 8))
    with pytest.raises(DriveError, match="closed loop"):
        rig.calibration.run()
    assert rig.is_off


def test_a_calibration_that_does_not_begin_is_reported():
    rig = Calibrated()
    rig.wire.before = lambda request: request.writes and request.address == 0x63 and rig.deafen(1)
    with pytest.raises(DriveError, match="does not begin"):
        rig.calibration.run()
    assert rig.is_off


def test_a_line_that_falls_silent_ends_it_and_is_reported_as_not_confirmed():
    rig = Calibrated()
    rig.at(60, lambda _: rig.deafen(-1))
    with pytest.raises(NodeError) as caught:
        rig.calibration.run()
    assert "NOT CONFIRMED" in str(caught.value)


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
