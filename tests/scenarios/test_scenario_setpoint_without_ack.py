"""Drives whose bit 12 proves nothing: the error of the default handshake names the remedy, with which the axis reaches its target.

Four kinds are simulated: bit 12 never rises; it falls while bit 4 is still set; every write of 6060h clears it, or
pulses it. The tests assert the plant, and the inputs of the drive.
"""

from __future__ import annotations

import pytest

from axisbus.cia402.port import ValueTransport
from axisbus.errors import MotionTimeout, Replaced, SetPointError
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.sim.fault_injection import NEVER
from kit.cell import SCALE
from kit.plant_probe import ENABLED, OFF
from kit.scenarios.simulated_bus import Line, enable

KINDS = {
    "never": {"acknowledge_never": True},
    "early": {"acknowledge_duration": 0.001},
    "cleared": {"mode_clears_acknowledge": 0.05},
    "pulsed": {"mode_pulses_acknowledge": 0.05},
}
ON_CHANGE = 'handshake = "on-change"'
PERIOD = 0.01
BIT_4, RELATIVE, HALT = 0x10, 0x40, 0x100
TRAVELS = {
    "with SYNC": {},
    "statusword once per change": {
        "inputs": {"statusword": ValueTransport.EVENT_PDO},
        "max_age": {"statusword": float("inf")},
    },
    "statusword by SDO": {"inputs": {"statusword": ValueTransport.SDO}, "max_age": {"statusword": 0.35}},
    "without 6062h": {"inputs": {"demand": ValueTransport.NONE}},
    "controlword by SDO": {"outputs": {"controlword": ValueTransport.SDO}},
}


def apply_fault_settings(drive, kind: str) -> None:
    for name, value in KINDS[kind].items():
        setattr(drive.dials, name, value)


def played(scenario, kind: str, axis: str = ON_CHANGE, **changes):
    """An enabled cell whose drive is of a kind; 6060h is written in every cycle, as an RPDO that holds it does."""
    cell = scenario.simulated("x", axis=axis, **changes)
    apply_fault_settings(cell.drive(), kind)
    cell.each_cycle(lambda *_: cell.device().write(0x6060, 0, cell.drive().mode))
    return cell.enabled()


def words(cell) -> list[tuple[int, float]]:
    """Every new controlword that the drive receives from now on, with its target in degrees."""
    drive, heard = cell.drive(), []
    hear = drive._evaluate_controlword

    def watched(word: int) -> None:
        if not heard or heard[-1][0] != word:
            heard.append((word, drive.target_position / SCALE))
        hear(word)

    drive._evaluate_controlword = watched
    return heard


def edges(heard) -> list[float]:
    """The targets at the rising edges of bit 4, which was low before."""
    risen = zip([(0, 0.0), *heard], heard, strict=False)
    return [new[1] for old, new in risen if new[0] & BIT_4 and not old[0] & BIT_4]


def settled(cell, target: float) -> bool:
    cell.run(0.6)
    return round(cell.where() * SCALE) == round(target * SCALE) and cell.speed() == 0.0


# -- the remedy ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_the_error_of_the_default_handshake_names_the_remedy(scenario, golden, kind):
    cell = played(scenario, kind, axis="")
    error = cell.failure_of(cell.x.move_absolute(2000.0))
    cell.must_be_still(within=2.0, stages=ENABLED)
    assert isinstance(error, SetPointError)
    assert 'handshake = "on-change" in [axes.x]' in error.remedy
    golden(f"bit_12_{kind}", error)


# -- with it -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("travels", TRAVELS)
@pytest.mark.parametrize("kind", KINDS)
def test_moves_arrive(scenario, kind, travels):
    cell = played(scenario, kind, port=TRAVELS[travels])
    for target in (20.0, -3.0, -2.9, -2.9, -2.89, 7.5):
        cell.x.move_absolute(target).wait(10)
        assert settled(cell, target)
    cell.x.move_relative(-10.0).wait(10)
    assert settled(cell, -2.5)
    cell.x.move_additive(4.0).wait(10)
    assert settled(cell, 1.5)


@pytest.mark.parametrize("way", ["halt", "stop", "quick_stop"])
@pytest.mark.parametrize("kind", KINDS)
def test_stops_stop_and_leave_nothing_behind(scenario, kind, way):
    cell = played(scenario, kind)
    for offset in (0, 1, 3, 5, 8, 12, 30):
        cell.x.move_relative(500.0)
        cell.run(offset * PERIOD) if offset else None
        stop = getattr(cell.x, way)()
        stop.wait(5)
        cell.must_be_still(within=0.1, stages=OFF if way == "quick_stop" else ENABLED)
        cell.x.release() if way == "stop" else None
        cell.x.enable().wait(5)
        stood = cell.where()
        target = round(stood) - 4.0
        cell.x.move_absolute(target).wait(10)
        assert settled(cell, target), offset
        assert cell.farthest(since=cell.moment() - 1.0)[1] < stood + 0.1, offset


@pytest.mark.parametrize("travels", ["with SYNC", "without 6062h"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_new_move_replaces_the_old_at_any_moment(scenario, kind, travels):
    cell = played(scenario, kind, port=TRAVELS[travels])
    heard = words(cell)
    for offset in (*range(20), 30, 45):
        for last in (-2.0 - offset / 10, 100.0, 400.0):
            heard.clear()
            first = cell.x.move_absolute(300.0)
            cell.run(offset * PERIOD) if offset else None
            second = cell.x.move_absolute(last, velocity=400.0)
            assert cell.end_of(second) is None, (offset, last)
            assert isinstance(cell.end_of(first), Replaced)
            assert settled(cell, last), (offset, last, cell.told())
            assert edges(heard) in ([300.0, last], [last])
            cell.x.move_absolute(0.0, velocity=400.0).wait(10)


def test_a_halted_axis_moves_to_its_new_target_only_and_once(scenario):
    """Two edges of an absolute target are one move, and none of them is relative (bit 6)."""
    for deaf in (False, True):
        cell = played(scenario, "never")
        cell.drive().dials.ignore_setpoint_during_halt = deaf
        heard = words(cell)
        cell.x.move_relative(500.0)
        cell.run(1.0)
        cell.x.halt().wait(3)
        stood = cell.where()
        heard.clear()
        cell.x.move_relative(-30.0).wait(10)
        assert settled(cell, stood - 30.0)
        assert cell.farthest(since=cell.moment() - 2.0)[1] < stood + 0.1
        assert edges(heard) == [round(stood - 30.0, 2)] * 2
        risen = [word for word, _ in heard if word & BIT_4]
        assert risen[0] & HALT
        assert not risen[-1] & HALT
        assert not any(word & RELATIVE for word, _ in heard)


def test_bit_4_is_held_for_a_time_and_repeated(scenario):
    """A drive that looks at its controlword every 15 ms only must not miss the edge."""
    cell = played(scenario, "never", period="2ms")
    drive, looked, hear = cell.drive(), [0], cell.drive()._evaluate_controlword
    step = drive.step
    drive.step = lambda dt: (step(dt), slow(drive._word))

    def slow(word: int) -> None:
        if int(drive.time / 0.015) != looked[-1]:
            looked.append(int(drive.time / 0.015))
            hear(word)

    drive._evaluate_controlword = slow
    for target in (5.0, 8.0, 2.0):
        cell.x.move_absolute(target).wait(10)
        assert settled(cell, target)


@pytest.mark.parametrize("offset", range(2, 9))
def test_the_set_point_of_a_halt_has_its_own_edge(scenario, offset):
    """Without 6062h a halted drive gets its actual position; bit 4 of the move may have been high just before."""
    cell = played(scenario, "never", port=TRAVELS["without 6062h"])
    heard = words(cell)
    cell.x.move_relative(500.0, velocity=20.0)
    cell.run(offset * PERIOD)
    cell.x.halt().wait(5)
    cell.run(0.5)
    assert edges(heard)[0] == 500.0
    assert abs(edges(heard)[-1] - cell.where()) < 0.05


def test_a_halt_whose_new_target_has_not_arrived_fails_and_disables_the_drive(scenario):
    """Without 6062h and without bit 12 only the target that is read back (607Ah) confirms it."""
    cell = played(scenario, "never", port=TRAVELS["without 6062h"])
    cell.x.move_relative(500.0)
    cell.run(1.0)
    cell.device().dictionary.live[0x607A << 8] = lambda: 50_000
    error = cell.failure_of(cell.x.halt())
    assert "accepts no new target while it is halted" in error.observed
    assert cell.stage() in OFF


# -- nothing is done that was not seen -----------------------------------------------------------------------------------


@pytest.mark.parametrize("travels", TRAVELS)
@pytest.mark.parametrize("distance", [0.06, 0.15, 1.0, 500.0])
def test_a_set_point_that_is_not_taken_is_no_move(scenario, golden, distance, travels):
    cell = played(scenario, "never", port=TRAVELS[travels])
    cell.drive().dials.acknowledge_delay = NEVER
    for _ in range(2):  # nor the second time, when the drive has been sent there before
        error = cell.failure_of(cell.x.move_absolute(distance))
        assert isinstance(error, SetPointError)
        assert cell.where() == 0.0
        cell.run(3.0)
        cell.x.reset().wait(5)
        cell.x.enable().wait(5)
    if (distance, travels) == (500.0, "with SYNC"):
        golden("set_point_not_seen", error)


@pytest.mark.parametrize("travels", ["with SYNC", "without 6062h"])
@pytest.mark.parametrize("last", [-50.0, 80.0, 400.0])
def test_a_replacement_that_is_not_taken_is_no_move(scenario, last, travels):
    """It continues to the target before: away from the new one, past it, or to a place short of it."""
    cell = played(scenario, "never", port=TRAVELS[travels])
    cell.x.move_absolute(300.0)
    cell.run(0.5)
    cell.drive().dials.acknowledge_delay = NEVER
    error = cell.failure_of(cell.x.move_absolute(last))
    assert isinstance(error, SetPointError)
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP and not cell.core().stop_sequence, 3.0)
    cell.must_be_still(within=0.1, stages=(ENABLED, *OFF))
    assert abs(cell.where() - last) > 10.0


@pytest.mark.parametrize("travels", ["with SYNC", "without 6062h"])
@pytest.mark.parametrize("last", [0.0, 0.05, 0.15, -20.0, 300.0])
def test_a_halted_axis_that_continues_to_its_old_target_is_not_done(scenario, last, travels):
    cell = played(scenario, "never", port=TRAVELS[travels])
    cell.x.move_absolute(100.0)
    cell.run(0.7)
    cell.drive().dials.ignore_setpoint_during_halt = (
        True  # also to the set-point that the halt gives without 6062h
    )
    cell.x.halt().wait(3)
    cell.drive().dials.acknowledge_delay = NEVER
    error = cell.failure_of(cell.x.move_absolute(cell.where() + last))
    assert isinstance(error, (SetPointError, MotionTimeout))
    assert travels != "with SYNC" or isinstance(error, SetPointError)


def test_a_halted_axis_is_not_done_before_it_could_have_continued(scenario):
    """Its feedback is late, so that it seems to be at standstill at first, and its bit 10 is not usable."""
    cell = played(scenario, "never", port=TRAVELS["without 6062h"])
    cell.drive().dials.feedback_delay = 0.15
    cell.x.move_absolute(100.0, velocity=20.0)
    cell.run(1.0)
    cell.drive().dials.ignore_setpoint_during_halt = cell.drive().dials.target_reached_always = True
    cell.x.halt().wait(3)
    cell.drive().dials.acknowledge_delay = NEVER
    cell.run(0.5)
    cell.failure_of(cell.x.move_absolute(cell.where()))


def test_a_move_to_the_present_position_is_done_at_once(scenario):
    cell = played(scenario, "never")
    cell.x.move_absolute(10.0).wait(5)
    cell.run(0.5)
    for target in (10.0, 10.01, 10.0):
        start = cell.now
        cell.x.move_absolute(target).wait(3)
        assert cell.now - start < 0.6
        assert settled(cell, target)


def test_an_axis_that_stopped_a_little_short_may_be_moved_to_the_same_target_again(scenario):
    cell = played(scenario, "never", port=TRAVELS["without 6062h"])
    cell.x.move_absolute(10.0).wait(5)
    cell.run(0.5)
    cell.drive().dials.sticks = 1000.0
    cell.drive().axis.motor.position -= 10.0  # it sticks there
    cell.x.halt().wait(3)
    cell.x.move_absolute(10.0).wait(5)


# -- on a bus ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_on_a_bus_moves_arrive_stop_and_are_replaced(tmp_path, kind):
    with Line(tmp_path, axis=ON_CHANGE) as line:
        apply_fault_settings(line.drive(), kind)
        with line.open() as cell:
            x = cell["x"]
            enable(x)
            x.move_absolute(5.0).wait(10)
            assert abs(line.where() - 5.0) < 0.02
            away = x.move_absolute(1000.0)
            line.run(0.6)
            line.must_move()
            x.move_absolute(0.0).wait(10)
            assert isinstance(away.exception(), Replaced)
            assert abs(line.where()) < 0.02
            x.move_absolute(1000.0)
            line.run(0.6)
            x.halt().wait(10)
            line.must_be_still(stages=ENABLED)
            x.move_relative(-5.0).wait(10)


@pytest.mark.parametrize("kind", ["never", "early"])
def test_on_a_bus_the_error_of_the_default_handshake_names_the_remedy(tmp_path, kind):
    with Line(tmp_path) as line:
        apply_fault_settings(line.drive(), kind)
        with line.open() as cell:
            enable(cell["x"])
            error = _failure(cell)
            line.must_be_still(stages=ENABLED)
    assert isinstance(error, SetPointError)
    assert 'handshake = "on-change" in [axes.x]' in error.remedy


def _failure(cell: Machine) -> Exception:
    with pytest.raises(SetPointError) as caught:
        cell["x"].move_absolute(2000.0).wait(10)
    return caught.value
