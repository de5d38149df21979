"""Old values are unknown: each by its own age, not by a late cycle, and never passed off as fresh."""

from __future__ import annotations

import pytest

from axisbus.cia402.port import Capabilities, Inputs, Sample, ValueTransport
from axisbus.errors import NodeError, StaleError, StateError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.parameters import DemandUse
from axisbus.motion.states import AxisState
from kit.motion.plant_recorder import HALT, Watch
from kit.motion.rig import PERIOD, rig

NAMES = ("statusword", "mode", "position", "velocity", "torque", "demand")
AGES = {"statusword": 0.5, "mode": 1.0, "position": 0.1, "velocity": 0.2, "torque": 0.3, "demand": 0.1}
SYNC = dict.fromkeys(NAMES, ValueTransport.SYNC_PDO)


def image(ages=AGES) -> AxisImage:
    return AxisImage(Capabilities(SYNC, {}, True, ages), PERIOD, 2.0, 0.05, DemandUse.USE)


def inputs(now: float, stamp: float, **changes) -> Inputs:
    """All values received at ``stamp``; ``changes`` replace samples."""
    values = {
        "statusword": Sample(0x0637, stamp),
        "mode": Sample(1, stamp),
        "position": Sample(1000, stamp),
        "velocity": Sample(20, stamp),
        "torque": Sample(3, stamp),
        "demand": Sample(1010, stamp),
    }
    return Inputs(now, True, **(values | changes))


def known(img: AxisImage) -> dict[str, bool]:
    return {name: getattr(img, name) is not None for name in NAMES}


def run_silent(img: AxisImage, stamp: float, seconds: float) -> None:
    """Cycles in time, in which nothing new is received."""
    for number in range(round(seconds / PERIOD) + 1):
        img.update(inputs(stamp + number * PERIOD, stamp))


@pytest.mark.parametrize("name", NAMES)
def test_each_value_has_its_own_age(name):
    img = image()
    limit = AGES[name]
    run_silent(img, 0.0, limit - PERIOD)
    assert known(img)[name]
    img.update(inputs(limit, 0.0))
    img.update(inputs(limit + PERIOD, 0.0))
    assert not known(img)[name]


def test_a_value_without_an_age_never_grows_old():
    img = image({})
    run_silent(img, 0.0, 3.0)
    assert all(known(img).values())


def test_a_value_that_was_never_received_is_unknown():
    img = image()
    img.update(Inputs(0.0, False, None, None, None, None, None, None))
    assert not any(known(img).values())
    assert img.reference is None
    assert not img.standstill


def test_a_late_cycle_does_not_make_values_old():
    """The SYNC that asks for them comes from the scan itself: they are as old as it is late."""
    img = image()
    for number in range(5):
        img.update(inputs(number * PERIOD, number * PERIOD - 0.001))
    last = 4 * PERIOD - 0.001
    img.update(inputs(4 * PERIOD + 0.25, last))  # 0.25 s late: position and velocity are older than their age
    assert all(known(img).values())
    img.update(inputs(5 * PERIOD + 0.25, last))  # and now a SYNC went out and was not answered
    assert not known(img)["position"]


def test_values_of_a_new_sync_after_a_late_cycle_are_fresh():
    img = image()
    img.update(inputs(0.0, 0.0))
    img.update(inputs(0.3, 0.0))
    img.update(inputs(0.31, 0.305))
    assert all(known(img).values())


# The effect of an old value on the axis.


def lose(r, *names: str) -> None:
    """From now on nothing new is received of these values."""
    port = r.ports["x"]
    read = port.read
    kept = read(r.now)

    def frozen(now):
        return read(now)._replace(**{name: getattr(kept, name) for name in names})

    port.read = frozen


def test_a_position_that_is_too_old_raises_instead_of_being_shown():
    r = rig().enabled()
    assert r.axis.position == 0.0
    lose(r, "position", "demand")
    r.run(0.05)
    assert r.axis.position == 0.0  # still within its age of 0.1 s
    r.run(0.1)
    with pytest.raises(StaleError, match="position \\(6064h\\) is unknown"):
        _ = r.axis.position
    assert r.scan.snapshots["x"].position is None
    assert r.axis.velocity == 0.0


@pytest.mark.parametrize(("name", "code"), [("velocity", "606Ch"), ("torque", "6077h")])
def test_stale_velocity_and_torque_raise_an_error(name, code):
    r = rig().enabled()
    lose(r, name)
    r.run(0.2)
    with pytest.raises(StaleError, match=code):
        getattr(r.axis, name)


def test_a_statusword_that_is_too_old_stops_the_axis_with_a_quick_stop():
    r = rig().enabled()
    r.axis.move_velocity(100.0).wait(2)
    watch = Watch(r)
    lose(r, "statusword")
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP)
    assert "statusword (6041h) of node 1 is unknown" in str(r.axis.error)
    r.run(1.5)
    assert abs(r.drive.axis.motor.velocity) < 1.0
    assert watch.words[1] & ~HALT == 0x02
    assert all(word & 0x0F != 0x0F for word in watch.words[1:])


def test_when_nothing_at_all_arrives_the_node_is_named_as_lost():
    r = rig().enabled()
    r.axis.move_velocity(100.0).wait(2)
    lose(r, *NAMES)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP)
    assert isinstance(r.axis.error, NodeError)
    assert "no longer sends process data" in r.axis.error.message


def test_an_axis_at_standstill_without_a_statusword_goes_to_errorstop():
    r = rig().enabled()
    lose(r, "statusword")
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP, 1.0)


def test_a_disabled_axis_whose_values_stop_is_sent_nothing():
    r = rig()
    r.run(0.1)
    watch = Watch(r)
    lose(r, *NAMES)
    r.run(1.0)
    assert watch.words == []
    assert r.axis.state is AxisState.DISABLED


def test_after_a_lost_statusword_the_axis_needs_a_reset_and_an_enable():
    r = rig().enabled()
    port = r.ports["x"]
    read = port.read
    lose(r, "statusword")
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP, 1.0)
    r.run(1.0)
    port.read = read
    watch = Watch(r)
    r.run(1.0)
    assert 4 not in watch.transitions
    assert 16 not in watch.transitions
    with pytest.raises(StateError, match="ErrorStop"):
        r.axis.move_relative(1.0).wait(1)
    r.axis.reset().wait(2)
    r.axis.enable().wait(3)
    r.axis.move_relative(1.0).wait(3)


def test_a_long_suspension_stops_the_axis_and_names_itself():
    r = rig().enabled()
    handle = r.axis.move_velocity(100.0)
    handle.wait(2)
    r.cycle.dials.send_blocks = 0.6
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP)
    assert "did not run for 0.6" in str(r.axis.error)
    r.run(1.0)
    assert abs(r.drive.axis.motor.velocity) < 1.0


def test_a_short_suspension_is_only_lateness():
    r = rig().enabled()
    r.axis.move_velocity(100.0).wait(2)
    for _ in range(5):
        r.cycle.dials.send_blocks = 0.15  # longer than the age of every value
        r.run(0.3)
    assert r.axis.state is AxisState.CONTINUOUS_MOTION
    assert r.axis.error is None
    assert r.scan.lateness.skipped >= 5 * 14


def test_a_drive_that_sends_its_word_only_on_change_is_not_stale_in_silence():
    events = dict.fromkeys(("statusword", "mode"), ValueTransport.EVENT_PDO)
    r = rig(port={"inputs": events, "event_timer": 0.4}).enabled()
    r.run(5.0)
    assert r.axis.state is AxisState.STANDSTILL
    r.axis.move_absolute(10.0).wait(3)


def test_an_event_word_without_a_timer_is_polled_by_sdo_and_stays_known():
    r = rig(port={"inputs": {"statusword": ValueTransport.SDO, "mode": ValueTransport.SDO}}).enabled()
    r.run(5.0)
    assert r.axis.state is AxisState.STANDSTILL
    r.axis.move_absolute(10.0).wait(5)


def test_the_position_of_an_axis_is_stale_after_its_scan_has_ended():
    r = rig()
    r.enabled()
    assert r.axis.position == pytest.approx(0.0, abs=0.01)
    r.scan.end()
    with pytest.raises(StaleError, match="position") as caught:
        _ = r.axis.position
    assert "nothing more is received" in caught.value.observed


def test_the_position_of_an_axis_is_stale_while_the_scan_hangs():
    r = rig()
    r.enabled()
    r.cycle.wait_until(r.now + 0.2)
    assert r.axis.position == pytest.approx(0.0, abs=0.01)
    r.cycle.wait_until(r.now + 0.2)
    with pytest.raises(StaleError, match="position") as caught:
        _ = r.axis.position
    assert "no cycle for 0.4" in caught.value.observed
