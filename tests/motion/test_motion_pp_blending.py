"""Targets that a drive passes: the time of the next profile, and the notes, cycle by cycle."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from axisbus.motion.blending.mode import BufferMode
from axisbus.motion.blending.pp_blending import BlendedTarget, PpBlending
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.moves.prepare import RampTransfers
from axisbus.motion.moves.profile import MoveProfile
from kit.motion.steps import Drive

UNIT = 1000.0  # increments of a degree in the rig


def profile(speed: float, down: float = 400_000.0, timeout: float | None = None) -> MoveProfile:
    ramp = int(down / 1000)
    return MoveProfile(int(speed), ramp, ramp, speed, down, timeout, down, down)


class Passed:
    """A move from 0 to 100,000 increments, and a second one to 200,000."""

    def __init__(
        self, mode: str, first: MoveProfile, second: MoveProfile, taken: float = 0.0, **changes
    ) -> None:
        self.drive = Drive(**changes)
        self.first, self.second = CommandStatus("first"), CommandStatus("second")
        self.first.begin()
        self.passing = PpBlending(
            BlendedTarget(100_000, first, BufferMode.BUFFERED, self.first), self.drive.parameters
        )
        part = BlendedTarget(200_000, second, BufferMode(f"blending_{mode}"), self.second)
        self.passing.add(part, self.drive.now)
        self.passing.taken(self.drive.now + taken)

    def at(self, position: int, override: float = 1.0) -> MoveProfile | None:
        image, _ = self.drive.cycle(position=position, statusword=0x1237, mode=1)
        image.override = override
        return self.passing.look(image)

    def requested_at(self, override: float = 1.0) -> list[tuple[int, MoveProfile]]:
        """The positions at which another profile was written to the drive, during its whole move."""
        seen = ((place, self.at(place, override)) for place in range(0, 200_001, 100))
        return [(place, profile) for place, profile in seen if profile is not None]


FAST, SLOW = profile(200_000.0), profile(100_000.0)
CHANGE = (200_000.0**2 - 100_000.0**2) / (2 * 400_000.0)  # increments from the one speed to the other


@pytest.mark.parametrize(
    ("mode", "first", "second", "before"),
    [
        ("low", SLOW, FAST, 0.0),
        ("previous", SLOW, FAST, 0.0),
        ("next", SLOW, FAST, CHANGE),
        ("high", SLOW, FAST, CHANGE),
        ("low", FAST, SLOW, CHANGE),
        ("next", FAST, SLOW, CHANGE),
        ("previous", FAST, SLOW, 0.0),
        ("high", FAST, SLOW, 0.0),
    ],
)
@pytest.mark.parametrize("taken", [0.0, 0.05])
def test_the_next_move_is_requested_once_and_earlier_by_the_time_of_the_change(
    mode, first, second, before, taken
):
    asked = Passed(mode, first, second, taken).requested_at()
    assert [profile for _, profile in asked] == [second]
    early = before + taken * first.speed if before else 0.0
    assert asked[0][0] == pytest.approx(100_000 - early, abs=100)


def test_under_an_override_the_change_is_shorter():
    (asked, _), *more = Passed("low", FAST, SLOW).requested_at(0.5)
    assert asked == pytest.approx(100_000 - CHANGE / 4, abs=100)
    assert not more


def test_the_duration_of_a_change_that_was_held_is_not_used():
    (asked, _), *_ = Passed("low", FAST, SLOW, taken=30.0).requested_at()
    assert asked == pytest.approx(100_000 - CHANGE - 0.25 * 200_000.0, abs=100)


def test_each_blended_move_ends_when_its_end_is_passed():
    play = Passed("low", FAST, FAST)
    play.at(99_999)
    assert (play.first.status, play.second.status) == (Status.ACTIVE, Status.BUSY)
    play.at(100_000)
    assert (play.first.status, play.second.status) == (Status.DONE, Status.ACTIVE)
    assert play.passing.commands == 1


def test_without_a_position_the_first_move_does_not_end():
    play = Passed("low", SLOW, FAST)
    image, _ = play.drive.cycle(statusword=0x1237, mode=1)
    assert image.position is None
    assert play.passing.look(image) is None
    assert play.first.busy


def test_an_equal_profile_is_not_requested_again_but_its_time_begins_again():
    assert Passed("low", FAST, FAST).requested_at() == []
    timed = profile(200_000.0, timeout=3.0)
    assert [each for _, each in Passed("low", timed, timed).requested_at()] == [timed]


@pytest.mark.parametrize(("down", "kept"), [(400_000.0, False), (250_000.0, False), (100_000.0, True)])
def test_a_deceleration_that_would_be_written_too_late_is_not_taken(down, kept):
    (_, asked), *_ = Passed("previous", FAST, weak := profile(100_000.0, down)).requested_at()
    assert (asked.deceleration, asked.down) == ((400, 400_000.0) if kept else (weak.deceleration, down))
    assert (asked.velocity, asked.acceleration) == (weak.velocity, weak.acceleration)


@pytest.mark.parametrize(("last", "kept"), [(220_000, True), (450_000, False)])
def test_a_deceleration_that_was_not_taken_is_compared_again_at_each_further_end(last, kept):
    """The drive still brakes with the first one, not with that of the move whose end comes next."""
    weak = profile(200_000.0, 100_000.0)
    play = Passed("previous", FAST, weak)
    third = CommandStatus("third")
    play.passing.add(BlendedTarget(last, weak, BufferMode("blending_previous"), third), play.drive.now)
    (_, second), *rest = play.requested_at()
    assert second.down == (400_000.0 if kept else 100_000.0)
    assert {each.down for _, each in rest} == ({400_000.0} if kept else set())
    assert bool(third.note) == kept


def test_a_drive_without_6084h_keeps_the_acceleration_with_which_it_brakes_as_well():
    without = Drive().parameters.objects - {0x6084}
    weak = profile(100_000.0, 100_000.0)
    (_, asked), *_ = Passed("previous", FAST, weak, objects=without).requested_at()
    assert (asked.velocity, asked.acceleration, asked.deceleration) == (100_000, 400, 400)
    assert (asked.up, asked.down) == (400_000.0, 400_000.0)


def test_a_move_that_takes_over_more_slowly_has_a_note():
    play = Passed("low", FAST, FAST)
    play.drive.says(velocity=0)
    image, _ = play.drive.cycle(position=100_000, velocity=100_000, statusword=0x1237, mode=1)
    play.passing.look(image)
    assert "instead of 200" in play.second.note


def test_target_reached_of_the_first_move_does_not_end_the_move_that_joined():
    drive, reached, acknowledge = Drive(), 0x0400, 0x1000
    ready = SimpleNamespace(
        step=lambda *_: True, cancel=lambda _: None, set_point_source=None, pending_mode_switch=None
    )
    ready.ramps = RampTransfers((), drive.parameters)
    first = CommandStatus("first")
    move = PositionMove(500, SLOW, drive.parameters, ready, None)
    for word in (0x0237, 0x0237 | acknowledge):
        assert not move.step(*drive.cycle(statusword=word, mode=1, position=500))
    move.join(BlendedTarget(900, SLOW, BufferMode.LOW, CommandStatus("second")), first, drive.image)
    assert not move.step(*drive.cycle(statusword=0x0237 | reached, position=500))
    assert move.set_point.target == 500
    targets = set()
    for _ in range(10):
        for request in drive.order.sdo:
            drive.answers(request.id)
        up = acknowledge if drive.order.bits else 0
        move.step(*drive.cycle(statusword=0x0237 | reached | up, position=900))
        targets.add(drive.order.target_position)
    assert 900 in targets
    assert first.status is Status.DONE
    assert move.step(*drive.cycle(statusword=0x0237 | reached, position=900))
