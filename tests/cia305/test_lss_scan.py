"""LSS fast scan in virtual time: it finds every slave, even if frames are lost or late, or several slaves answer at once."""

from __future__ import annotations

import heapq
import itertools
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia305.dialogue import AdaptiveLssTimeout, LssTiming
from axisbus.cia305.fastscan import FastScan
from axisbus.cia305.scan_result import Check, KnownIdentity, Scanned
from axisbus.errors import ArgumentError, LssError, LssTimeout
from kit.lss_line import HandSlave, Line, Sticky

ONES = 0xFFFF_FFFF


def scan(line: Line, known: KnownIdentity | None = None, timing: LssTiming | None = None) -> Scanned:
    result: Scanned = line.run(FastScan(AdaptiveLssTimeout(timing), known).run())
    return result


def ids(found: Scanned) -> list[tuple[int, int, int, int]]:
    return [slave.address.parts for slave in found.slaves]


def test_the_dialogue_with_one_slave_begins_and_ends_as_in_the_standard() -> None:
    line = Line(HandSlave(1, 0x80000000, 0, 5))
    assert ids(scan(line)) == [(1, 0x80000000, 0, 5)]
    digits = [frame.hex() for frame in line.sent]
    assert digits[:2] == ["0400000000000000"] * 2  # all slaves to waiting state
    assert digits[2] == "5100000000800000"  # is there any slave?
    assert digits[3] == "51000000001f0000"  # bit 31 of the vendor-ID is 0?
    assert digits[34:37] == [
        "5100000000000000",
        "5101000000000000",
        "5101000000000001",
    ]  # 0? 1! go on with part 1
    assert "5105000000000300" in digits  # the last confirmation, with LSSNext 0
    assert digits[-3:] == ["5100000000800000"] * 3  # none is left, with all tries of a request


def test_a_slave_that_was_found_is_in_configuration_and_has_no_node_id_yet() -> None:
    slave = HandSlave(1, 2, 3, 4)
    scan(Line(slave))
    assert (slave.state, slave.active, slave.pending) == ("configuration", 255, 255)


@pytest.mark.parametrize(
    "numbers", [(0, 0, 0, 0), (ONES, ONES, ONES, ONES), (0xAAAAAAAA,) * 4, (1 << 31, 1, 0, ONES)]
)
def test_every_address_is_found_in_under_3_s(numbers: tuple[int, int, int, int]) -> None:
    line = Line(HandSlave(*numbers))
    assert ids(scan(line)) == [numbers]
    assert line.now < 3.0


def test_slaves_that_differ_in_one_bit_of_each_part_are_all_found() -> None:
    base = (0x12345678, 0x9ABCDEF0, 0x0F0F0F0F, 0x33CC33CC)
    family = {base}
    for part, bit in itertools.product(range(4), (0, 15, 31)):
        numbers = list(base)
        numbers[part] ^= 1 << bit
        family.add((numbers[0], numbers[1], numbers[2], numbers[3]))
    line = Line(*(HandSlave(*numbers) for numbers in family))
    assert ids(scan(line)) == sorted(family)


def test_siblings_cost_a_guess_for_each_part_that_they_share() -> None:
    alone, pair = Line(HandSlave(7, 8, 9, 1000)), Line(HandSlave(7, 8, 9, 1000), HandSlave(7, 8, 9, 1001))
    scan(alone)
    scan(pair)
    assert len(pair.sent) - len(alone.sent) < 70  # the serial number again: 32 bits, some asked twice


@settings(max_examples=60, deadline=None)
@given(st.sets(st.tuples(*[st.one_of(st.integers(0, 3), st.integers(0, ONES))] * 4), min_size=1, max_size=5))
def test_any_set_of_slaves_is_found(addresses: set[tuple[int, int, int, int]]) -> None:
    line = Line(*(HandSlave(*numbers) for numbers in addresses))
    found = scan(line)
    assert ids(found) == sorted(addresses)
    assert not any(slave.twins for slave in found.slaves)


def test_slaves_with_a_node_id_are_left_alone() -> None:
    configured = HandSlave(1, 1, 1, 1, node_id=5)
    assert ids(scan(Line(configured, HandSlave(1, 1, 1, 2)))) == [(1, 1, 1, 2)]
    assert (configured.state, configured.active) == ("waiting", 5)


def test_an_empty_bus_is_an_empty_list_within_a_second() -> None:
    line = Line()
    assert scan(line) == Scanned((), False)
    assert line.now < 1.0


@pytest.mark.parametrize("direction", ["one slave", "two slaves"])
def test_any_single_frame_may_be_lost(direction: str) -> None:
    """Each request and each answer of a whole scan is lost once, one scan for each."""
    addresses = [(5, 6, 7, 0x55)] + ([(5, 6, 7, 0x54)] if direction == "two slaves" else [])

    def line_without(number: int) -> Line:
        return Line(*(HandSlave(*numbers) for numbers in addresses), lost=lambda n: n == number)

    total = line_without(-1)
    scan(total)
    for number in range(total.frames):
        assert ids(scan(line_without(number))) == sorted(addresses), f"with frame {number} lost"


@pytest.mark.parametrize("seed", range(10))
def test_one_frame_in_twenty_lost_at_random(seed: int) -> None:
    chance = random.Random(seed)
    addresses = sorted({tuple(chance.randrange(1 << 32) for _ in range(4)) for _ in range(3)})
    line = Line(*(HandSlave(*each) for each in addresses), lost=lambda _: chance.random() < 0.05)  # type: ignore[arg-type]
    assert ids(scan(line)) == addresses


@pytest.mark.parametrize("delay", [0.01, 0.014, 0.05, 0.15])
def test_the_wait_adapts_to_a_slow_slave(delay: float) -> None:
    slave = HandSlave(0x1234, 5, 6, 7)
    slave.delay = delay
    pace = AdaptiveLssTimeout()
    line = Line(slave)
    found = line.run(FastScan(pace).run())
    assert ids(found) == [slave.id]
    assert pace.timeout >= 1.5 * delay


def test_a_slave_that_grows_slow_in_the_middle_is_still_found() -> None:
    """Its answers come after the wait is over, and look like answers to the next request."""
    slave = HandSlave(0x12345678, 0x9ABC, 0xDEF0, 0x5A5A5A5A)
    line = Line(slave)

    def slower(number: int) -> bool:
        slave.delay = 0.04 if number > 90 else 0.001
        return False

    line.lost = slower
    assert ids(scan(line)) == [slave.id]


def test_a_slow_slave_and_a_fast_one_are_both_found() -> None:
    quick, slow = HandSlave(3, 1, 1, 0x0F0F), HandSlave(3, 1, 1, 0xF0F0)
    slow.delay = 0.03
    assert ids(scan(Line(quick, slow))) == [quick.id, slow.id]


def test_a_slave_slower_than_the_first_wait_needs_a_higher_floor() -> None:
    slave = HandSlave(1, 2, 3, 4)
    slave.delay = 0.6
    assert ids(scan(Line(slave), timing=LssTiming(floor=0.8))) == [slave.id]


def test_the_floor_is_kept_and_can_be_raised() -> None:
    pace = AdaptiveLssTimeout(LssTiming(floor=0.1))
    scan_line = Line(HandSlave(1, 2, 3, 4))
    scan_line.run(FastScan(pace).run())
    assert pace.slowest is not None
    assert pace.slowest < 0.001
    assert pace.timeout == 0.1


@pytest.mark.parametrize("floor", [0.0, -1.0, float("nan"), 3.0])
def test_a_floor_that_makes_no_sense_is_refused(floor: float) -> None:
    with pytest.raises(ArgumentError, match="time-out"):
        LssTiming(floor=floor)


def test_known_identity_numbers_save_the_requests_for_their_bits() -> None:
    slave = HandSlave(ONES, ONES, ONES, 4)
    free, told = Line(slave), Line(slave)
    scan(free)
    found = scan(told, KnownIdentity(vendor_id=ONES, product_code=ONES, revision_number=ONES))
    assert ids(found) == [slave.id]
    assert len(free.sent) - len(told.sent) > 3 * 60  # each one-bit costs a silent request and an answered one


def test_slaves_other_than_the_known_ones_are_reported_and_not_configured() -> None:
    wanted, other = HandSlave(0xC0B00, 8, 1, 1), HandSlave(0x22, 8, 1, 1)
    found = scan(Line(wanted, other), KnownIdentity(vendor_id=0xC0B00))
    assert ids(found) == [wanted.id]
    assert found.others
    assert other.state == "waiting"


def test_two_slaves_with_one_identity_are_reported_as_such() -> None:
    (found,) = scan(Line(HandSlave(1, 2, 3, 0), HandSlave(1, 2, 3, 0))).slaves
    assert found.twins


def test_a_slave_that_is_pulled_out_in_the_middle_is_reported() -> None:
    slave = HandSlave(0xFFFF, 2, 3, 4)

    def pulled(number: int) -> bool:
        slave.silent = number > 60
        return False

    with pytest.raises(LssTimeout, match="went silent") as caught:
        scan(Line(slave, lost=pulled))
    assert caught.value.service == "fastscan"


def test_a_slave_that_contradicts_itself_ends_in_an_error_not_in_an_endless_scan() -> None:
    class Liar(HandSlave):
        """Answers that it is there, and to no bit at all."""

        def _fastscan(self, value: int, bit: int, sub: int, following: int) -> bytes | None:
            return super()._fastscan(value, bit, sub, following) if bit == 0x80 else None

    line = Line(Liar(1))
    with pytest.raises(LssError, match="found no slave 1, although one answers") as caught:
        scan(line)
    assert "--timeout" in caught.value.remedy
    assert line.now < 60.0


def test_a_slave_that_stays_in_waiting_is_put_aside_by_its_name() -> None:
    assert ids(scan(Line(Sticky(1, 2, 3, 4), HandSlave(1, 2, 3, 5)))) == [(1, 2, 3, 4), (1, 2, 3, 5)]


def test_a_slave_that_cannot_be_excluded_is_reported_so_and_hides_no_other() -> None:
    sticky = Sticky(1, 2, 3, 4)
    sticky.deaf_for = {0x43}
    found = scan(Line(sticky, HandSlave(1, 2, 3, 5)))
    assert [(each.address.parts, each.check, each.answers_on) for each in found.slaves] == [
        ((1, 2, 3, 4), Check.UNSELECTABLE, True),
        ((1, 2, 3, 5), Check.NOT_NEEDED, False),
    ]
    assert not found.incomplete


def test_a_second_answer_that_was_only_late_makes_no_twin() -> None:
    """The first answer to each request comes twice for a while, as after a retry."""
    slave = HandSlave(1, 2, 3, 4)
    line = Line(slave)
    hear = slave.hear
    doubles = [True] * (1 + 128 + 4)  # up to the last confirmation

    def twice(frame: bytes) -> bytes | None:
        answer = hear(frame)
        if answer is not None and doubles:
            doubles.pop()
            heapq.heappush(line._coming, (line.now + 0.001, 10_000 + line.frames, answer))
        return answer

    slave.hear = twice  # type: ignore[method-assign]
    (found,) = scan(line).slaves
    assert (found.address.parts, found.twins) == (slave.id, False)


def test_progress_is_reported_in_bits() -> None:
    line = Line(HandSlave(1, 2, 3, 4), HandSlave(1, 2, 3, 5))
    scan(line)
    assert max(bits for _, bits in line.progress) == 128
    assert {found for found, _ in line.progress} == {0, 1, 2}
