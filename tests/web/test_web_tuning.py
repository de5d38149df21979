"""Trials at the client handler, on a simulated cell in virtual time: rights, questions, and every end of one stops the plant."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.web.access.tokens import Role
from axisbus.web.commands.clients import PageClient
from kit.cell import cell_file, cell_text
from kit.page_clients import Pages

MOVE = {"distance": "20", "velocity": "60", "acceleration": "400", "seconds": "1.0"}
TURN = {"velocity": "30", "acceleration": "400", "seconds": "0.6"}
ALIVE = 0.1  # s between two words of a page


class Tuning(Pages):
    """Pages that try steps."""

    def __init__(self, machine: Machine) -> None:
        super().__init__(machine)
        self.news: list[dict[str, Any]] = []

    def step(self, place: PageClient, kind: str = "position", *, sure: bool = True, **changes: str) -> None:
        values = (MOVE if kind == "position" else TURN) | changes
        self.press += sure
        self.ask(place, f"step_{kind}", "x", sure=sure, press=self.press, values=values)
        self.hear(place)

    def go_on(self, place: PageClient, seconds: float, *, alive: bool = True) -> None:
        """Let time pass while the page answers for its trial."""
        for _ in range(round(seconds / ALIVE)):
            if alive:
                self.ask(place, "trial_beat", press=self.press)
            self.pass_(ALIVE)
            self.hear(place)

    def hear(self, place: PageClient) -> None:
        told = self.desk.trials.unread(place.identity.number)
        if told is not None:
            json.dumps(told, allow_nan=False)
            self.news.append(told)

    @property
    def last(self) -> dict[str, Any]:
        return self.news[-1]

    def running(self, place: PageClient) -> None:
        """A trial whose axis moves."""
        self.step(place)
        self.go_on(place, 0.2)
        assert abs(self.speed()) > 15.0

    def ended(self, place: PageClient, why: str) -> None:
        """It is over and the plant is at standstill, and stays so."""
        self.pass_(0.3)
        self.hear(place)
        assert self.last["phase"] == "over"
        assert why in self.last["why"]
        assert self.last["figures"] == {}
        for _ in range(10):
            self.go_on(place, 0.2)
            assert self.speed() == pytest.approx(0.0, abs=0.1)


@pytest.fixture
def pages(tmp_path: Path) -> Iterator[Tuning]:
    path = cell_file(tmp_path, "xy", axis="position_limits = [-100.0, 100.0]")
    with Machine.simulated(path) as machine:
        yield Tuning(machine)


@pytest.fixture
def place(pages: Tuning) -> PageClient:
    place = pages.operator()
    pages.enabled(place, "x", "y")
    return place


def test_limits_that_do_not_hold_before_it_is_homed_are_reported_as_such(tmp_path):
    path = tmp_path / "cell.toml"
    text = cell_text("x", axis="position_limits = [-100.0, 100.0]")
    path.write_text(text.replace("required = false", "required = true"), encoding="utf-8")
    with Machine.simulated(path) as machine:
        pages = Tuning(machine)
        place = pages.operator()
        pages.enabled(place, "x")
        pages.step(place, sure=False)
        pages.go_on(place, 0.5)
        assert "position from -100 to 100 deg, after homing" in pages.last["question"]


def test_the_question_names_the_motion_and_the_limits(pages, place):
    pages.step(place, sure=False)
    pages.go_on(place, 0.5)
    asked = pages.last["question"]
    assert pages.last["press"] == pages.press
    for words in (
        "x",
        "by 20 deg",
        "0.000 to 20.000 deg",
        "60 deg/s",
        "400 deg/s²",
        "-100 to 100 deg",
        "velocity 400 deg/s",
    ):
        assert words in asked
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    pages.step(place, "velocity", sure=False)
    assert "30 deg/s" in pages.last["question"]


def test_the_question_names_the_velocity_that_the_override_of_another_program_gives(pages, place):
    x = pages.machine["x"]
    for override, words in (
        (1.5, "at up to 90 deg/s (60 deg/s, and an override of 1.5)"),
        (0.5, "takes 0.742 s"),
    ):
        x.set_override(override)
        pages.pass_(0.1)
        pages.step(place, sure=False)
        pages.go_on(place, 0.5)
        assert words in (pages.last["question"] if override > 1.0 else pages.told(place)[-1][1])
    pages.machine.set_override(0.0)
    pages.pass_(0.1)
    pages.step(place)
    assert "x does not move" in pages.told(place)[-1][1]
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


def test_a_position_trial_moves_forth_and_back_and_is_measured(pages, place):
    pages.step(place)
    pages.go_on(place, 1.0)
    assert pages.machine["x"].position == pytest.approx(20.0, abs=0.1)
    pages.go_on(place, 1.5)
    assert [told["phase"] for told in pages.news] == ["asked", "there", "back", "over"]
    assert pages.machine["x"].position == pytest.approx(0.0, abs=0.2)
    assert pages.machine["x"].state is AxisState.STANDSTILL
    assert pages.last["why"] == ""
    for side in ("there", "back"):
        found = pages.last["figures"][side]
        assert 0.3 < float(found["settled"].split()[0]) < 0.7  # the ramps take 0.48 s
        assert float(found["overshoot"].split("%")[0]) < 2.0
        assert found["error"].endswith(" deg")
    assert pages.told(place) == []


def test_a_step_that_does_not_arrive_in_time_goes_back_to_its_start_and_not_beyond(pages, place):
    """Another program slows it down: it has reached about 13 of the 20 degrees when it is sent back."""
    x = pages.machine["x"]
    pages.step(place, velocity="30", seconds="1.15")
    pages.go_on(place, 0.1)
    x.set_override(0.4)
    seen = []
    for _ in range(30):
        pages.go_on(place, 0.1)
        seen.append(x.position)
        if pages.last["phase"] == "back":
            x.set_override(1.0)
    assert pages.last["phase"] == "over"
    assert 10.0 < max(seen) < 18.0
    assert min(seen) > -0.1
    assert x.position == pytest.approx(0.0, abs=0.1)


def test_every_cycle_of_a_trial_can_be_fetched(pages, place):
    pages.step(place)
    pages.go_on(place, 2.5)
    drawn = pages.desk.trials.outcome(pages.last["number"]).samples()
    json.dumps(drawn, allow_nan=False)
    assert drawn["unit"] == "deg"
    for side, (start, end) in {"there": (0.0, 20.0), "back": (20.0, 0.0)}.items():
        times, actual, target = (drawn[side][name] for name in ("times", "actual", "target"))
        assert 100 <= len(times) < 110  # 1 s in cycles of 10 ms
        assert max(later - time for time, later in pairwise(times)) < 0.011
        assert (actual[0], actual[-1]) == pytest.approx((start, end), abs=0.2)
        assert (target[0], target[-1]) == pytest.approx((start, end), abs=0.2)
    assert pages.desk.trials.outcome(99) is None


def test_a_step_of_velocity_turns_and_stops_again(pages, place):
    pages.step(place, "velocity")
    pages.go_on(place, 0.5)
    assert pages.speed() == pytest.approx(30.0, abs=1.0)
    pages.go_on(place, 1.5)
    assert pages.last["why"] == ""
    assert 0.05 < float(pages.last["figures"]["there"]["settled"].split()[0]) < 0.3
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    assert pages.machine["x"].state is AxisState.STANDSTILL


def test_another_trial_may_follow_and_only_the_last_are_kept(pages, place):
    for _ in range(6):
        pages.step(place, seconds="0.5", distance="1")
        pages.go_on(place, 1.6)
        assert (pages.last["phase"], pages.last["why"]) == ("over", "")
    assert pages.desk.trials.outcome(2) is None
    assert pages.desk.trials.outcome(6) is not None


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"distance": "0"}, "a step of 0 is not allowed"),
        ({"distance": "1e-9"}, "less than one increment"),
        ({"distance": "nan"}, "not a finite number"),
        ({"distance": "inf"}, "not a finite number"),
        ({"distance": "1e300"}, "does not fit"),
        ({"distance": ""}, "no distance given"),
        ({"distance": "much"}, "is not a valid distance"),
        ({"distance": "101", "seconds": "9"}, "beyond the position limits"),
        ({"velocity": "0"}, "must be above 0"),
        ({"velocity": "-5"}, "must be above 0"),
        ({"velocity": "nan"}, "not a finite number"),
        ({"velocity": "401"}, "max_velocity"),
        ({"velocity": ""}, "no velocity given"),
        ({"acceleration": ""}, "no acceleration given"),
        ({"acceleration": "0"}, "must be above 0"),
        ({"acceleration": "nan"}, "not a finite number"),
        ({"seconds": ""}, "no seconds given"),
        ({"seconds": "0"}, "must be above 0"),
        ({"seconds": "nan"}, "not a finite number"),
        ({"seconds": "11"}, "11 s for each side is too long"),
        ({"seconds": "0.4"}, "takes 0.483 s"),
        ({"seconds": "0.7"}, "takes 0.483 s"),  # its last third would not be of the rest alone
    ],
)
@pytest.mark.parametrize("sure", [False, True])
def test_invalid_values_are_refused_before_the_question_and_after(pages, place, changes, words, sure):
    pages.step(place, sure=sure, **changes)
    pages.go_on(place, 0.3)
    (told,) = pages.told(place)
    assert told[0] == "refused"
    assert words in told[1]
    assert pages.news == []
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(
    ("velocity", "words"), [("0", "a step of 0"), ("nan", "not a finite"), ("-401", "max_velocity")]
)
def test_an_invalid_velocity_is_refused(pages, place, velocity, words):
    pages.step(place, "velocity", velocity=velocity)
    assert words in pages.told(place)[0][1]
    assert pages.news == []


def test_a_trial_needs_the_controls_an_operator_and_an_enabled_axis_at_standstill(pages):
    looker, place = pages.admit(Role.OBSERVER), pages.admit()
    for who, words in ((looker, "observer page"), (place, "no page has the controls")):
        pages.step(who)
        assert words in pages.told(who)[0][1]
    pages.ask(place, "take")
    pages.step(place)
    assert "x is Disabled" in pages.told(place)[0][1]
    pages.enabled(place, "x")
    pages.ask(place, "move_velocity", "x", values={"velocity": "20"})
    pages.pass_(0.5)
    pages.step(place)
    assert "x moves" in pages.told(place)[0][1]
    pages.ask(place, "halt", "x")
    pages.pass_(0.5)
    pages.machine.simulated_node(1).fault(0x4310)
    pages.pass_(0.5)
    pages.step(place)
    assert "ErrorStop" in pages.told(place)[-1][1]
    assert pages.news == []


def test_a_late_yes_moves_nothing(pages, place):
    pages.press += 1
    pages.ask(place, "beat")
    pages.ask(place, "step_position", "x", sure=True, press=1, values=MOVE, sent=pages.now - 90.0 - 0.3)
    pages.go_on(place, 0.3)
    assert "too late" in pages.told(place)[0][1]
    assert pages.speed() == pytest.approx(0.0, abs=0.1)


def test_two_at_a_time_are_refused_and_the_first_continues(pages, place):
    pages.running(place)
    pages.step(place)
    assert "another trial is running" in pages.told(place)[0][1]
    pages.press -= 1
    pages.go_on(place, 2.3)
    assert (pages.last["phase"], pages.last["why"]) == ("over", "")


# -- ends of a trial -----------------------------------------------------------------------------------------------------------


def test_a_trial_ends_when_its_page_leaves(pages, place):
    pages.running(place)
    pages.desk.remove(place)
    pages.pass_(0.3)
    assert pages.speed() == pytest.approx(0.0, abs=0.1)
    where = pages.machine["x"].position
    pages.pass_(2.0)
    assert pages.machine["x"].position == pytest.approx(where, abs=0.1)
    other = pages.operator()
    pages.step(other)
    pages.go_on(other, 2.5)
    assert pages.last["why"] == ""


def test_a_trial_ends_by_silence_and_late_messages_do_not_revive_it(pages, place):
    pages.running(place)
    pages.go_on(place, 0.3, alive=False)
    pages.ended(place, "the server received nothing from its page")


def test_a_late_beat_ends_it(pages, place):
    pages.running(place)
    pages.ask(place, "trial_beat", press=pages.press, sent=pages.now - 90.0 - 0.3)
    pages.ended(place, "the server received nothing from its page")


def test_a_trial_ends_when_its_page_is_hidden(pages, place):
    pages.running(place)
    pages.ask(place, "trial_end")
    pages.ended(place, "its page has ended it")


@pytest.mark.parametrize("do", ["take_over", "give_back"])
def test_a_trial_ends_with_the_controls(pages, place, do):
    other = pages.admit()
    pages.running(place)
    pages.ask(other if do == "take_over" else place, do)
    pages.ended(place, "no longer has the controls")


@pytest.mark.parametrize("do", ["halt", "halt_all", "quick_stop", "quick_stop_all"])
def test_a_stop_of_an_observer_ends_it(pages, place, do):
    looker = pages.admit(Role.OBSERVER)
    pages.running(place)
    pages.ask(looker, do, "x")
    pages.ended(place, "halted, or stopped")


@pytest.mark.parametrize("do", ["halt", "quick_stop", "quick_stop_all"])
def test_a_stop_during_the_pause_of_a_trial_prevents_the_return(pages, place, do):
    looker = pages.admit(Role.OBSERVER)
    pages.step(place)
    pages.go_on(place, 0.8)
    assert pages.machine["x"].state is AxisState.STANDSTILL
    pages.ask(looker, do, "x")
    pages.ended(place, "halted, or stopped")
    assert pages.machine["x"].position == pytest.approx(20.0, abs=0.1)


def test_the_server_s_own_stop_ends_it(pages, place):
    pages.running(place)
    pages.desk.stop_all()
    pages.ended(place, "halted, or stopped")


def test_a_halt_of_another_program_ends_it(pages, place):
    pages.running(place)
    pages.machine["x"].halt()
    pages.ended(place, "halt")


def test_a_halt_of_another_program_during_the_pause_prevents_the_return(pages, place):
    pages.step(place)
    pages.go_on(place, 0.8)
    pages.machine["x"].halt()
    pages.ended(place, "")
    assert pages.machine["x"].position == pytest.approx(20.0, abs=0.1)


def test_a_fault_ends_it_and_is_reported(pages, place):
    pages.running(place)
    pages.machine.simulated_node(1).fault(0x4310)
    pages.ended(place, "")
    assert pages.last["why"]
    assert pages.machine["x"].state is AxisState.ERRORSTOP


@pytest.mark.parametrize("wait", [0.2, 0.8])
def test_a_fault_of_another_axis_ends_it_also_during_the_pause(pages, place, wait):
    pages.step(place)
    pages.go_on(place, wait)
    pages.machine.simulated_node(2).fault(0x4310)
    pages.ended(place, "")
    assert pages.last["why"]


@pytest.mark.parametrize("do", ["move_relative", "disable"])
def test_another_command_takes_over(pages, place, do):
    pages.running(place)
    pages.ask(place, do, "x", values={"distance": "5"} if do == "move_relative" else {})
    pages.pass_(1.0)
    pages.ended(place, f"another command took over: {do}()")


def test_a_command_that_is_refused_leaves_nothing_moving(pages, place):
    pages.running(place)
    pages.ask(place, "move_relative", "x", values={"distance": "1", "velocity": "nan"})
    pages.ended(place, "another command took over")


def test_a_trial_leaves_the_other_axis_alone_and_is_left_alone(pages, place):
    pages.running(place)
    pages.ask(place, "move_relative", "y", values={"distance": "10"})
    pages.go_on(place, 2.4)
    assert (pages.last["phase"], pages.last["why"]) == ("over", "")
    assert pages.machine["y"].position == pytest.approx(10.0, abs=0.1)


def test_a_trial_is_no_longer_observed_after_its_end(pages, place, monkeypatch):
    forgotten = []
    forget = type(pages.machine.session).forget
    monkeypatch.setattr(
        type(pages.machine.session), "forget", lambda self, who: (forgotten.append(who), forget(self, who))
    )
    pages.running(place)
    pages.ask(place, "trial_end")
    pages.pass_(0.2)
    assert len(forgotten) == 1
