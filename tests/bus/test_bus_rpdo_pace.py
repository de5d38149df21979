"""When RPDOs are sent: event-driven ones on change and repeatedly; the drive always has the same values as if all were sent."""

from __future__ import annotations

import itertools
import math
import random
import struct
from dataclasses import replace

import pytest

from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.bus.pdo.plan import PdoPlan, Policy, make_plan
from axisbus.bus.pdo.rpdo import REPEAT, Frame, RpdoImage, RpdoPace, arrange
from kit.bus.pdo_configurations import NO_TORQUE, objects, rpdo

PERIOD = 0.004
ONE = ("6060/8 607A/32 6040/16", "60FF/32")
APART = ("6040/16", "607A/32 6060/8", "60FF/32")
EACH = ("6040/16", "6060/8 6040/16", "607A/32 6040/16", "60FF/32 6040/16")
ON_ARRIVAL = Policy(remap=False, sync=False)
WITH_SYNC = Policy(remap=False)


def plan_of(mappings: tuple[str, ...], policy: Policy, deadline: dict[int, int] | None = None) -> PdoPlan:
    """RPDOs 1, 2, ... with these mappings; ``deadline``: 14xxh:05 in ms by number."""
    pdos = [
        replace(rpdo(number, text, 255), event_timer=(deadline or {}).get(number, 0))
        for number, text in enumerate(mappings, 1)
    ]
    policy = (
        replace(policy, fixed=frozenset((True, pdo.number) for pdo in pdos)) if not policy.sync else policy
    )
    return make_plan(5, DevicePdos(tuple(pdos), ()), objects(), NO_TORQUE, policy)


def images_of(plan: PdoPlan) -> list[RpdoImage]:
    images = [RpdoImage(pdo) for pdo in plan.active if pdo.receive]
    for image in images:
        for entry, _ in image.unknown:
            image.put(entry.index, entry.subindex, 0)
    return images


class Master:
    """Cycles of one port: the pace, and its frames in each; time is counted in cycles."""

    def __init__(self, mappings: tuple[str, ...], policy: Policy = ON_ARRIVAL, **options: object) -> None:
        plan = plan_of(mappings, policy, **options)  # type: ignore[arg-type]
        self.pace = RpdoPace([pdo for pdo in plan.active if pdo.receive], images_of(plan), PERIOD)
        self.cycles = 0
        self.previous: int | None = None
        self.sent: list[tuple[int, Frame]] = []

    def cycle(self, controlword: int | None = 0x0F, **given: int) -> list[Frame]:
        frames = self.pace.frames(given, controlword, self.previous, self.cycles * PERIOD)
        self.previous = self.previous if controlword is None else controlword
        self.sent += [(self.cycles, frame) for frame in frames]
        self.cycles += 1
        return frames

    def gaps(self, can_id: int) -> list[float]:
        """Seconds between the frames of one RPDO, the present time included."""
        times = [cycle * PERIOD for cycle, frame in self.sent if frame[0] == can_id] + [self.cycles * PERIOD]
        return [later - earlier for earlier, later in itertools.pairwise(times)]


def whole(mode: int, target: int, word: int) -> Frame:
    return 0x205, struct.pack("<biH", mode, target, word)


def test_an_event_driven_rpdo_is_sent_when_its_content_changes() -> None:
    master = Master(ONE)
    assert master.cycle(mode=1, target_position=5) == [whole(1, 5, 0x0F)]
    assert [master.cycle(mode=1, target_position=5) for _ in range(10)] == [[]] * 10
    assert master.cycle(mode=1, target_position=6) == [whole(1, 6, 0x0F)]
    assert master.cycle(mode=1, target_position=6) == []
    assert master.cycle(0x1F, mode=1, target_position=6) == [whole(1, 6, 0x1F)]
    assert master.cycle(0x1F, mode=1, target_position=6) == []


def test_targets_that_change_in_every_cycle_are_sent_in_every_cycle() -> None:
    master = Master(ONE)
    frames = [master.cycle(mode=8, target_position=position) for position in range(100)]
    assert frames == [[whole(8, position, 0x0F)] for position in range(100)]


def test_a_synchronous_rpdo_is_sent_in_every_cycle() -> None:
    master = Master(ONE, WITH_SYNC)
    assert [master.cycle(mode=1, target_position=5) for _ in range(50)] == [[whole(1, 5, 0x0F)]] * 50


def test_an_unchanged_rpdo_is_repeated_ten_times_a_second() -> None:
    master = Master(ONE)
    for _ in range(1000):
        master.cycle(mode=1, target_position=5)
    gaps = master.gaps(0x205)
    assert max(gaps) <= 0.1
    assert len(gaps) == pytest.approx(1000 * PERIOD / 0.1, rel=0.1)


def test_a_frame_that_the_drive_has_lost_is_made_good() -> None:
    """The quick stop goes out and is not taken: without a repetition it would not come before something else changes."""
    master = Master(ONE)
    master.cycle(mode=3)
    assert master.cycle(0x02, mode=3) == [whole(3, 0, 0x02)]  # lost
    again = next(number for number in range(1, 1000) if master.cycle(0x02, mode=3))
    assert again * PERIOD <= REPEAT


@pytest.mark.parametrize("deadline", [5, 12, 30, 90, 250, 1000])
def test_a_drive_that_watches_for_an_rpdo_gets_it_well_within_its_time(deadline: int) -> None:
    master = Master(ONE, deadline={1: deadline})
    for _ in range(2000):
        master.cycle(mode=1, target_position=5)
    worst = max(master.gaps(0x205))
    assert worst <= max(PERIOD, min(REPEAT, deadline / 1000 / 3)) + 1e-9


def test_a_watched_rpdo_is_due_if_the_next_cycle_would_be_after_a_third_of_its_time() -> None:
    plan = plan_of(ONE, ON_ARRIVAL, {1: 750})
    pace = RpdoPace(
        [pdo for pdo in plan.active if pdo.receive], images_of(plan), scan_period=0.125, repeat=math.inf
    )
    sent = [pace.frames({"mode": 1}, 0x0F, 0x0F, now) for now in (0.0, 0.125, 0.125 + 2**-13)]
    assert [bool(frames) for frames in sent] == [True, False, True]


@pytest.mark.parametrize("policy", [ON_ARRIVAL, WITH_SYNC], ids=["on arrival", "with SYNC"])
def test_a_watched_rpdo_continues_when_its_values_are_no_longer_in_use(policy: Policy) -> None:
    """The drive begins to watch with the first one, and does not know that it is not needed any more."""
    master = Master(ONE, policy, deadline={2: 60})
    for _ in range(100):
        assert 0x305 not in [can_id for can_id, _ in master.cycle(mode=1, target_position=5)]  # never had it
    assert (0x305, struct.pack("<i", 9)) in master.cycle(mode=3, target_velocity=9)
    for _ in range(500):
        for can_id, data in master.cycle(mode=1, target_position=5):
            assert can_id == 0x205 or data == struct.pack("<i", 9)  # the present value of the drive
    assert max(master.gaps(0x305)) <= 0.02
    assert len(master.gaps(0x305)) <= 501 * PERIOD / 0.01  # and not in every cycle


def test_an_unwatched_rpdo_is_not_sent_while_it_is_not_in_use() -> None:
    master = Master(ONE)
    master.cycle(mode=3, target_velocity=9)
    for _ in range(500):
        assert 0x305 not in [can_id for can_id, _ in master.cycle(mode=1, target_position=5)]


def test_without_a_controlword_nothing_that_holds_it_is_repeated() -> None:
    master = Master(ONE, deadline={1: 30, 2: 30})
    master.cycle(mode=3, target_velocity=9)
    later = [frame for _ in range(200) for frame in master.cycle(None)]
    assert later
    assert {can_id for can_id, _ in later} == {0x305}


def test_an_edge_that_another_rpdo_sent_is_reversed_by_sending_the_first_rpdo_again() -> None:
    """RPDO1 says the same as when it was sent last, but RPDO3 has brought another controlword meanwhile."""
    master = Master(EACH)
    (before,) = master.cycle(0x0F)
    master.cycle(0x0F, target_position=5)
    assert master.cycle(0x1F, target_position=5) == [(0x405, struct.pack("<iH", 5, 0x1F))]
    (after,) = master.cycle(0x0F)
    assert struct.unpack("<bH", after[1])[1] == 0x0F
    assert after == before


def test_all_rpdos_are_sent_again_after_forget() -> None:
    master = Master(APART)
    master.cycle(mode=1, target_position=5)
    assert master.cycle(mode=1, target_position=5) == []
    master.pace.forget()
    assert {can_id for can_id, _ in master.cycle(mode=1, target_position=5)} == {0x205, 0x305}
    assert master.cycle(mode=1, target_position=5) == []


# -- the same as if every frame went out


class Drive:
    """Takes each frame at once; its values, and the target at each rising edge of bit 4."""

    def __init__(self, mappings: tuple[str, ...]) -> None:
        self.maps = {0x105 + 0x100 * number: text.split() for number, text in enumerate(mappings, 1)}
        self.has: dict[str, int] = {}
        self.edges: list[int | None] = []

    def hear(self, frames: list[Frame]) -> None:
        for can_id, data in frames:
            raw = int.from_bytes(data, "little")
            for word in self.maps[can_id]:
                key, bits = word.split("/")
                value, raw = raw & (1 << int(bits)) - 1, raw >> int(bits)
                if key == "6040" and value & 0x10 and not self.has.get(key, 0) & 0x10:
                    self.edges.append(self.has.get("607A"))
                self.has[key] = value


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("mappings", [ONE, APART, EACH], ids=["one", "apart", "each"])
def test_the_drive_has_the_same_values_in_every_cycle_as_with_every_frame(
    mappings: tuple[str, ...], seed: int
) -> None:
    chance = random.Random(seed)
    master, drive, reference = Master(mappings, deadline={1: 40}), Drive(mappings), Drive(mappings)
    images, previous = images_of(plan_of(mappings, ON_ARRIVAL)), None
    given: dict[str, int] = {}
    word: int | None = 0x06
    frames = 0
    for _ in range(400):
        if chance.random() < 0.2:
            word = chance.choice([None, 0x06, 0x0F, 0x1F, 0x10F])
        if chance.random() < 0.2:
            names = ("mode", "target_position", "target_velocity")
            given = {name: chance.randrange(1, 4) for name in names if chance.random() < 0.6}
        sent = master.cycle(word, **given)
        every = arrange(images, given, word, previous)
        previous = previous if word is None else word
        drive.hear(sent)
        reference.hear(every)
        frames += len(sent) - len(every)
        assert drive.has == reference.has
    assert drive.edges == reference.edges
    assert frames < -200  # and with far fewer of them
