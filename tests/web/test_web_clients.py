"""The client handler, on a simulated cell in virtual time: several pages together, judged on the plants."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from axisbus.errors import OwnershipError
from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.web.access.tokens import Role
from axisbus.web.commands import clients
from kit.cell import cell_file
from kit.page_clients import Pages

AT_ONCE = 0.14  # seconds in which 40 deg/s are braked, before the core itself ends a jog


@pytest.fixture
def pages(tmp_path: Path) -> Iterator[Pages]:
    path = cell_file(tmp_path, "xy", axis="rated_torque = 10.0\nmax_torque = 5.0")
    with Machine.simulated(path) as machine:
        yield Pages(machine)


def test_enabling_needs_the_controls_and_a_yes(pages):
    place = pages.admit()
    pages.ask(place, "enable", "x", sure=True)
    pages.pass_(1.0)
    assert "no page has the controls" in pages.told(place)[0][1]
    pages.ask(place, "take")
    pages.ask(place, "enable", "x")
    pages.pass_(1.0)
    assert "it has not been confirmed" in pages.told(place)[0][1]
    assert pages.machine["x"].state is AxisState.DISABLED
    pages.enabled(place, "x")


def test_a_flood_of_stops_is_given_to_the_core_as_a_few_and_the_last_one_counts(pages, monkeypatch):
    """All pages share one connection to the core, which takes 500 messages a second: an observer could delay the others' stops."""
    operator, observer = pages.operator(), pages.admit(Role.OBSERVER)
    pages.enabled(operator, "x", "y")
    given = []
    for verb in ("halt", "quick_stop"):
        stop = getattr(Axis, verb)

        def noted(axis, stop=stop, verb=verb):
            given.append((axis.name, verb))
            return stop(axis)

        monkeypatch.setattr(Axis, verb, noted)
    for _ in range(50):
        for _ in range(20):
            pages.ask(observer, "halt_all")
            pages.ask(observer, "halt", "x")
        pages.pass_(0.02)
    assert given.count(("x", "halt")) <= 110  # of 2000: at most two in each round
    assert given.count(("y", "halt")) <= 110  # of 1000
    pages.ask(operator, "quick_stop", "y")  # another stop does not wait
    assert given[-1] == ("y", "quick_stop")
    pages.pass_(0.1)
    pages.ask(observer, "halt", "x")
    pages.ask(operator, "move_velocity", "x", values={"velocity": "40"})
    pages.ask(observer, "halt", "x")  # equal to the one before, which has not ended, but after the command
    pages.pass_(0.5)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    assert pages.machine["x"].state is AxisState.STANDSTILL
    for _ in range(2):
        pages.ask(observer, "halt", "x")
    pages.ask(operator, "move_velocity", "x", values={"velocity": "40"})  # after both
    pages.pass_(0.5)
    assert pages.speed() == pytest.approx(40.0, abs=1.0)


def test_a_jog_continues_while_it_is_held_and_ends_when_it_is_released(pages):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.jog(place, velocity="40")
    assert pages.speed() == pytest.approx(40.0, abs=1.0)
    pages.ask(place, "jog_end")
    pages.pass_(AT_ONCE)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    assert pages.told(place) == []


@pytest.mark.parametrize(
    ("way", "typed", "speed"), [("-1", "30", -30.0), ("1", "-30", 30.0), ("-2", "", -100.0)]
)
def test_a_jog_has_the_direction_of_its_button_and_the_typed_or_default_speed(pages, way, typed, speed):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.press += 1
    pages.beat(place, way=way, velocity=typed)
    assert pages.speed() == pytest.approx(speed, abs=1.0)


@pytest.mark.parametrize("do", ["move_absolute", "move_velocity", "enable", "reset"])
def test_a_request_more_than_a_second_late_is_refused_and_reported(pages, do):
    place = pages.operator()
    pages.enabled(place, "x")
    values = {"position": "50", "velocity": "50"}
    pages.ask(place, do, "x", values=values, sure=True, sent=pages.now - 90.0 - 2.5)
    pages.pass_(0.5)
    assert pages.speed() == 0.0
    assert pages.told(place) == [("refused", f"{do} came 2.5 s late, and was not executed")]
    pages.ask(place, do, "x", values=values, sure=True, sent=pages.now - 90.0 - 0.5)
    assert pages.told(place) == []


@pytest.mark.parametrize(("do", "old"), [("jog", 0.8), ("move_velocity", 2.0), ("enable", 2.0)])
def test_a_page_with_old_values_moves_nothing_and_stops(pages, do, old):
    """A permanently slow network shows in the age of the values that the page shows at its request."""
    place = pages.operator()
    pages.enabled(place, "x")
    values = {"velocity": "50", "direction": "1"}
    for press, age, moves in ((1, old, False), (2, 0.3, do != "enable")):
        pages.ask(place, do, "x", values=values, sure=True, press=press, seen=pages.now - age)
        pages.pass_(0.1)
        assert (pages.speed() > 1.0) is moves
    told = pages.told(place)
    assert [text for _, text in told] == [
        f"the connection is slow, {old:.1f} s there and back: {do} was not executed"
    ]
    pages.ask(place, "move_velocity", "x", values=values)
    pages.pass_(0.5)
    pages.ask(place, "halt", "x", seen=pages.now - 100.0)
    pages.pass_(1.0)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("seen", [True, "1", 1e13, []])
def test_an_invalid_time_stamp_is_refused(pages, seen):
    place = pages.operator()
    pages.ask(place, "beat", seen=seen)
    assert pages.told(place) == [
        ("refused", "the server received a message that does not belong to this page")
    ]
    assert place.seen is None


def test_a_stop_that_is_received_late_is_still_executed(pages):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.ask(place, "move_velocity", "x", values={"velocity": "50"})
    pages.pass_(1.0)
    pages.ask(place, "halt", "x", sent=pages.now - 190.0)
    pages.pass_(1.0)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


def test_a_late_beat_halts_at_once(pages):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.jog(place, velocity="40")
    values = {"direction": "1", "velocity": "40"}
    pages.ask(place, "jog", "x", press=pages.press, values=values, sent=pages.now - 90.0 - 0.3)
    pages.pass_(AT_ONCE)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


def test_a_jog_ends_by_silence_and_late_beats_do_not_revive_it(pages):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.jog(place)
    pages.pass_(0.5)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    pages.beat(place)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


def test_a_jog_ends_when_its_page_leaves_and_the_controls_are_free(pages):
    place, other = pages.operator(), pages.admit()
    pages.enabled(place, "x")
    pages.jog(place, velocity="40")
    pages.desk.remove(place)
    pages.desk.remove(place)
    pages.pass_(AT_ONCE)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    pages.ask(other, "take")
    assert pages.desk.lease.held_by(other.identity)


@pytest.mark.parametrize("do", ["quick_stop_all", "halt_all", "quick_stop", "halt"])
def test_a_stop_by_an_observer_ends_a_jog_until_the_next_press(pages, do):
    place, looker = pages.operator(), pages.admit(Role.OBSERVER)
    pages.enabled(place, "x")
    pages.jog(place)
    pages.ask(looker, do, "x")
    pages.beat(place)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    assert pages.told(looker) == []


@pytest.mark.parametrize("looks", [0, 1])
def test_a_halt_of_another_program_ends_the_press_as_well(pages, looks):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.jog(place)
    pages.machine["x"].halt().wait()
    pages.pass_(looks * 0.02)  # where the next beat comes before the next look, that ends it
    pages.beat(place)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("soon", [0.0, 0.01, 0.05])
def test_a_beat_does_not_replace_a_halt_of_another_program(pages, soon):
    """While an axis brakes its state is that of the jog still: the beat itself must not revive it."""
    place = pages.operator()
    pages.enabled(place, "x")
    pages.jog(place)
    halted = pages.machine["x"].halt()
    pages.machine.sleep(soon)
    pages.now += soon
    pages.beat(place)
    assert halted.exception() is None
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    pages.jog(place)  # another press


def test_a_jog_of_a_disabled_axis_is_refused_once(pages):
    place = pages.operator()
    pages.press += 1
    pages.beat(place, times=20)
    assert [kind for kind, _ in pages.told(place)] == ["failed"]
    assert not place.deadman.held


@pytest.mark.parametrize("soon", [True, False], ids=["at once", "by its handle"])
def test_a_jog_without_control_of_the_machine_does_not_halt_the_motion_of_another_program(
    pages, monkeypatch, soon
):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.machine["x"].move_velocity(30.0).wait(5)
    refused = OwnershipError("this program does not have control of the machine")

    def jog(*_: object, **__: object) -> SimpleNamespace:
        if soon:
            raise refused
        return SimpleNamespace(busy=False, exception=lambda: refused)

    monkeypatch.setattr(clients, "jog", jog)
    pages.press += 1
    pages.beat(place)
    assert pages.speed() == pytest.approx(30.0, abs=0.5)
    assert any("does not have control" in text for _, text in pages.told(place))


@pytest.mark.parametrize("velocity", ["nan", "1e9"])
def test_a_jog_with_an_invalid_velocity_is_refused_with_the_message_of_the_library(pages, velocity):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.press += 1
    pages.beat(place, velocity=velocity)
    (told,) = pages.told(place)
    assert told[0] == "refused"
    assert told[1].startswith("x.jog(")
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("way", ["0", "nan"])
def test_a_jog_without_a_direction_is_refused(pages, way):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.press += 1
    pages.beat(place, way=way)
    assert "the direction is not valid" in pages.told(place)[0][1]


def test_taken_over_a_jog_ends_and_both_are_reported(pages):
    one, two = pages.operator(), pages.admit()
    pages.enabled(one, "x")
    pages.jog(one, velocity="40")
    pages.ask(two, "take")
    assert "has the controls" in pages.told(two)[0][1]
    pages.beat(one, velocity="40")
    assert abs(pages.speed()) > 15.0
    pages.ask(two, "take_over")
    pages.pass_(AT_ONCE)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    pages.beat(one)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    texts = [text for _, text in pages.told(one)]
    assert "page 2 at 127.0.0.1 has taken over the controls" in texts
    pages.ask(two, "disable", "x")
    pages.pass_(1.0)
    assert pages.machine["x"].state is AxisState.DISABLED


def test_a_move_continues_when_its_page_leaves(pages):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.ask(place, "move_absolute", "x", values={"position": "30", "velocity": "60"})
    pages.pass_(0.2)
    pages.desk.remove(place)
    pages.pass_(1.5)
    assert pages.machine["x"].position == pytest.approx(30.0, abs=0.1)


def test_step_and_velocity(pages):
    place = pages.operator()
    pages.enabled(place, "x", "y")
    pages.ask(place, "move_relative", "x", values={"distance": "-5"})
    pages.ask(place, "move_velocity", "y", values={"velocity": "-20"})
    pages.pass_(1.5)
    assert pages.machine["x"].position == pytest.approx(-5.0, abs=0.1)
    assert pages.speed("y") == pytest.approx(-20.0, abs=0.5)
    pages.ask(place, "halt", "y")
    pages.pass_(0.5)
    assert pages.speed("y") == pytest.approx(0.0, abs=0.1)
    assert [kind for kind, _ in pages.told(place)] in ([], ["note"])


def test_a_torque_needs_a_yes_turns_a_free_axis_and_ends_by_a_halt(pages):
    place = pages.operator()
    pages.enabled(place, "x")
    values = {"torque": "1,5", "slope": "100"}
    pages.ask(place, "torque_control", "x", values=values)
    pages.pass_(0.3)
    assert "it has not been confirmed" in pages.told(place)[0][1]
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    pages.ask(place, "torque_control", "x", sure=True, values=values)
    pages.pass_(0.1)
    assert pages.machine["x"].torque == pytest.approx(1.5, abs=0.05)
    assert pages.speed() > 5.0
    assert pages.told(place) == []
    pages.ask(place, "halt", "x")
    pages.pass_(1.0)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("do", ["quick_stop", "quick_stop_all", "halt_all"])
def test_an_observer_ends_a_torque_and_commands_none(pages, do):
    place, looker = pages.operator(), pages.admit(Role.OBSERVER)
    pages.enabled(place, "x")
    values = {"torque": "1", "slope": "100"}
    pages.ask(looker, "torque_control", "x", sure=True, values=values)
    pages.pass_(0.2)
    assert "it may only halt, stop" in pages.told(looker)[0][1]
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    pages.ask(place, "torque_control", "x", sure=True, values=values)
    pages.pass_(0.2)
    assert pages.speed() > 1.0
    pages.ask(looker, do, "x")
    pages.pass_(1.0)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, "no torque given"),
        ({"torque": "much"}, "'much' is not a valid torque"),
        ({"torque": "nan"}, "not a finite number"),
        ({"torque": "inf"}, "not a finite number"),
        ({"torque": "5.01"}, "max_torque is 5 N·m"),
        ({"torque": "-1e300"}, "max_torque is 5 N·m"),
        ({"torque": "1", "slope": "0"}, "slope 0 must be above 0"),
        ({"torque": "1", "slope": "-3"}, "slope -3 must be above 0"),
        ({"torque": "1", "slope": "1e30"}, "does not fit"),
    ],
)
def test_an_invalid_torque_is_refused_with_the_message_of_the_library(pages, values, words):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.ask(place, "torque_control", "x", sure=True, values=values)
    pages.pass_(0.3)
    (told,) = pages.told(place)
    assert told[0] == "refused"
    assert words in told[1]
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


def test_an_axis_without_power_or_in_fault_is_given_no_torque(pages):
    place = pages.operator()
    values = {"torque": "1", "slope": "100"}
    pages.ask(place, "torque_control", "x", sure=True, values=values)
    pages.pass_(0.3)
    assert pages.told(place)[0][0] == "failed"
    pages.enabled(place, "x")
    pages.machine.simulated_node(1).fault(0x4310)
    pages.pass_(0.5)
    pages.ask(place, "torque_control", "x", sure=True, values=values)
    pages.pass_(0.5)
    assert pages.told(place)[-1][0] == "failed"
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


def test_control_is_taken_only_by_a_page_with_the_controls_after_a_yes(pages):
    place, looker = pages.operator(), pages.admit(Role.OBSERVER)
    pages.ask(looker, "take_command", sure=True)
    assert pages.told(looker)[0][0] == "refused"
    pages.ask(place, "take_command")
    assert pages.told(place) == [("refused", "take_command(): it has not been confirmed")]
    pages.ask(place, "take_command", sure=True)
    pages.pass_(0.1)
    assert pages.told(place) == []
    pages.desk.observes_only = True
    pages.ask(place, "take_command", sure=True)
    assert "the server serves observer pages only" in pages.told(place)[0][1]


def test_a_flood_is_refused_and_the_stop_in_it_is_not(pages):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.ask(place, "move_velocity", "x", values={"velocity": "50"})
    pages.pass_(1.0)
    for _ in range(10_000):
        pages.desk.receive(place, "junk", pages.now)
    pages.ask(place, "move_velocity", "x", values={"velocity": "60"})
    pages.pass_(0.02)
    assert abs(pages.speed()) == pytest.approx(50.0, abs=0.5)
    for _ in range(10_000):
        pages.desk.receive(place, "junk", pages.now)
    pages.ask(place, "quick_stop", "x")
    pages.pass_(0.5)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    assert len(pages.told(place)) < 5


def test_a_fault_is_reported_with_its_cause_and_reset(pages):
    place = pages.operator()
    pages.enabled(place, "x")
    pages.ask(place, "move_velocity", "x", values={"velocity": "50"})
    pages.pass_(0.5)
    pages.machine.simulated_node(1).fault(0x8611)
    pages.pass_(1.0)
    assert pages.machine["x"].state is AxisState.ERRORSTOP
    pages.ask(place, "reset", "x")
    pages.pass_(1.0)
    assert pages.machine["x"].state is AxisState.DISABLED


def test_a_failure_of_one_axis_does_not_keep_a_stop_from_the_others(pages, monkeypatch):
    place = pages.operator()
    pages.enabled(place, "x", "y")
    pages.ask(place, "move_velocity", "y", values={"velocity": "50"})
    pages.pass_(0.5)

    def broken() -> None:
        raise ValueError("broken")

    monkeypatch.setattr(pages.machine["x"], "quick_stop", broken)
    with pytest.raises(ValueError, match="broken"):
        pages.ask(place, "quick_stop_all")
    pages.pass_(0.5)
    assert pages.speed("y") == pytest.approx(0.0, abs=0.1)


def test_links_are_only_for_operators(pages):
    operator, looker = pages.admit(), pages.admit(Role.OBSERVER)
    pages.ask(operator, "link")
    pages.ask(looker, "link")
    assert pages.told(operator) == [("link", "http://here/enter?token=t")]
    assert pages.told(looker)[0][0] == "refused"


def test_ended_commands_are_not_stored(pages):
    place = pages.operator()
    pages.enabled(place, "x")
    for _ in range(30):
        pages.ask(place, "halt", "x")
        pages.pass_(0.1)
    pages.jog(place)
    pages.pass_(1.0)
    assert len(place.running) + len(place.jogs) < 3
