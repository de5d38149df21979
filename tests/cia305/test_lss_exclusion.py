"""LSS fast scan with slaves that keep answering it: each is reported and excluded, and hides no other slave."""

from __future__ import annotations

import itertools
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia305 import master
from axisbus.cia305.dialogue import AdaptiveLssTimeout
from axisbus.cia305.exclude import DEPTH, GIVEN_UP, ROOT, of
from axisbus.cia305.fastscan import FastScan
from axisbus.cia305.scan_result import Check, KnownIdentity, Scanned
from axisbus.cia305.services import LssAddress
from kit.lss_line import AnswersAnything, AnswersOn, AnswersOnSelected, AnswersResets, HandSlave, Line, Sticky

ONES = 0xFFFF_FFFF
STACKS = (AnswersOn, AnswersOnSelected, AnswersAnything)
KINDS = (HandSlave, AnswersOn, AnswersOnSelected, AnswersAnything, AnswersResets, Sticky)
Numbers = tuple[int, int, int, int]


def scan(line: Line, known: KnownIdentity | None = None) -> Scanned:
    result: Scanned = line.run(FastScan(AdaptiveLssTimeout(), known).run())
    return result


def ids(found: Scanned) -> list[Numbers]:
    return [slave.address.parts for slave in found.slaves]


@pytest.mark.parametrize("stack", STACKS)
def test_a_slave_that_answers_on_is_reported_with_its_whole_address_which_it_confirms(
    stack: type[HandSlave],
) -> None:
    slave = stack(0xC0B00, 8, 1, 4711)
    line = Line(slave)
    found = scan(line)
    (one,) = found.slaves
    assert (one.address.parts, one.answers_on, one.check, one.has_node_id) == (
        slave.id,
        True,
        Check.CONFIRMED,
        False,
    )
    assert not found.incomplete
    asked = {frame[0] for frame in line.sent}
    assert {0x5A, 0x5B, 0x5C, 0x5D} <= asked
    assert line.now < 10.0


@pytest.mark.parametrize("stack", STACKS)
@pytest.mark.parametrize(
    "other",
    [
        (0xC0B00, 8, 1, 4710),
        (0xC0B00, 8, 1, 4712),
        (0, 0, 0, 0),
        (ONES, ONES, ONES, ONES),
        (0xC0B00, 9, 1, 4711),
    ],
)
def test_the_search_continues_for_others_before_and_behind_it(stack: type[HandSlave], other: Numbers) -> None:
    line = Line(stack(0xC0B00, 8, 1, 4711), HandSlave(*other))
    found = scan(line)
    assert ids(found) == sorted([other, (0xC0B00, 8, 1, 4711)])
    assert {slave.address.parts: slave.answers_on for slave in found.slaves} == {
        other: False,
        (0xC0B00, 8, 1, 4711): True,
    }
    assert line.now < 12.0


@settings(max_examples=60, deadline=None)
@given(
    st.dictionaries(
        st.tuples(*[st.one_of(st.integers(0, 2), st.integers(0, ONES))] * 4),
        st.sampled_from(KINDS),
        min_size=1,
        max_size=5,
    )
)
def test_any_mixture_of_stacks_is_found(kinds: dict[Numbers, type[HandSlave]]) -> None:
    line = Line(*(kind(*numbers) for numbers, kind in kinds.items()))
    found = scan(line)
    assert ids(found) == sorted(kinds)
    assert not found.incomplete
    for slave in found.slaves:
        kind = kinds[slave.address.parts]
        assert slave.answers_on == (kind in STACKS)
        assert slave.check is (Check.CONFIRMED if slave.answers_on else Check.NOT_NEEDED)
        assert not slave.twins
    assert line.now < 15.0 * len(kinds)


def test_every_combination_of_three_siblings() -> None:
    for kinds in itertools.product(KINDS, repeat=3):
        found = scan(Line(*(kind(7, 8, 9, serial) for serial, kind in zip((4, 5, 12), kinds, strict=True))))
        assert ids(found) == [(7, 8, 9, 4), (7, 8, 9, 5), (7, 8, 9, 12)], kinds
        assert [slave.answers_on for slave in found.slaves] == [kind in STACKS for kind in kinds], kinds


def test_a_cell_of_sixteen_drives_of_one_make_that_all_answer_on_is_found_in_under_half_a_minute() -> None:
    line = Line(*(AnswersOn(0xC0B00, 8, 1, 0x1000 + 37 * number) for number in range(16)))
    assert len(scan(line).slaves) == 16
    assert line.now < 30.0


@pytest.mark.parametrize("stack", STACKS)
def test_any_single_frame_may_be_lost(stack: type[HandSlave]) -> None:
    known = KnownIdentity(vendor_id=5, product_code=6, revision_number=7)

    def line_without(number: int) -> Line:
        return Line(
            stack(5, 6, 7, 0x55),
            HandSlave(5, 6, 7, 0x54),
            HandSlave(5, 6, 7, 0x57),
            lost=lambda n: n == number,
        )

    total = line_without(-1)
    scan(total, known)
    for number in range(STACKS.index(stack), total.frames, 12):  # all of them take minutes
        found = scan(line_without(number), known)
        assert ids(found) == [(5, 6, 7, 0x54), (5, 6, 7, 0x55), (5, 6, 7, 0x57)], f"with frame {number} lost"


def test_the_question_that_would_find_the_other_one_may_be_lost() -> None:
    question = bytes.fromhex("5156000000010303")  # is there a slave at 56h or 57h?
    line = Line(AnswersOn(5, 6, 7, 0x55), HandSlave(5, 6, 7, 0x57))
    lost: list[bytes] = []

    def first(_: int) -> bool:
        if line.sent[-1] == question and not lost:
            lost.append(question)
            return True
        return False

    line.lost = first
    assert ids(scan(line)) == [(5, 6, 7, 0x55), (5, 6, 7, 0x57)]
    assert lost


@pytest.mark.parametrize("seed", range(8))
def test_one_frame_in_a_hundred_lost_at_random(seed: int) -> None:
    chance = random.Random(seed)
    addresses = sorted({tuple(chance.randrange(1 << 32) for _ in range(4)) for _ in range(3)})
    slaves = [
        kind(*each) for kind, each in zip((AnswersOn, HandSlave, AnswersOnSelected), addresses, strict=True)
    ]  # type: ignore[misc]
    assert ids(scan(Line(*slaves, lost=lambda _: chance.random() < 0.01))) == addresses


def test_correct_slaves_are_in_configuration_state_at_the_end_and_unchanged() -> None:
    stubborn, good = AnswersOn(1, 2, 3, 4), HandSlave(1, 2, 3, 5)
    scan(Line(stubborn, good))
    assert (stubborn.state, good.state) == ("waiting", "configuration")
    assert {slave.pending for slave in (stubborn, good)} == {255}


def test_a_slave_that_has_a_node_id_and_answers_nevertheless_is_excluded_by_its_address() -> None:
    configured = AnswersOn(1, 2, 3, 4)
    hear = configured._fastscan
    line = Line(configured)
    configured.active = configured.pending = 5

    def always(frame: bytes) -> bytes | None:
        if frame[0] == 0x51:
            return hear(int.from_bytes(frame[1:5], "little"), frame[5], frame[6], frame[7])
        return AnswersOn.hear(configured, frame)

    configured.hear = always  # type: ignore[method-assign]
    (one,) = scan(line).slaves
    assert (one.answers_on, one.node_id, one.has_node_id) == (True, 5, True)


def test_a_slave_that_does_not_report_its_numbers_is_reported_as_not_checked() -> None:
    slave = AnswersOn(1, 2, 3, 4)
    slave.deaf_for = {0x5A, 0x5B, 0x5C, 0x5D}
    (one,) = scan(Line(slave)).slaves
    assert (one.check, one.node_id) == (Check.SILENT, 255)


def test_a_slave_that_reports_other_numbers_is_reported_so() -> None:
    slave = AnswersOn(1, 2, 3, 4)
    slave.errors[0x5D] = (9, 9)
    (one,) = scan(Line(slave)).slaves
    assert one.check is Check.OTHERWISE


def test_two_that_answer_on_with_one_identity_are_twins() -> None:
    (one,) = scan(Line(AnswersOn(1, 2, 3, 4), AnswersOn(1, 2, 3, 4))).slaves
    assert (one.twins, one.answers_on) == (True, True)


def test_slaves_other_than_the_known_ones_are_reported_and_not_configured() -> None:
    stubborn, wanted, other = AnswersOn(7, 8, 1, 4), HandSlave(7, 8, 1, 9), HandSlave(0x22, 8, 1, 1)
    found = scan(Line(stubborn, wanted, other), KnownIdentity(vendor_id=7))
    assert ids(found) == [(7, 8, 1, 4), (7, 8, 1, 9)]
    assert found.others
    assert other.state == "waiting"
    alone = scan(Line(AnswersOn(7, 8, 1, 4), HandSlave(7, 8, 1, 9)), KnownIdentity(vendor_id=7))
    assert not alone.others


def test_a_slave_that_answers_every_request_ends_the_search_with_a_reason() -> None:
    class Liar(HandSlave):
        """Answers every fast scan request, and has no selection."""

        def hear(self, frame: bytes) -> bytes | None:
            return b"\x4f".ljust(8, b"\0") if frame[0] == 0x51 else None

    line = Line(Liar(9))
    found = scan(line)
    assert (found.slaves, found.incomplete) == ((), GIVEN_UP)
    assert "disconnect it" in found.incomplete
    assert line.now < 60.0


def test_a_slave_that_contradicts_itself_is_reported_by_the_range_that_it_is_in() -> None:
    class Liar(HandSlave):
        """Answers in a branch, and in neither half of it."""

        def _fastscan(self, value: int, bit: int, sub: int, following: int) -> bytes | None:
            answer = super()._fastscan(value, bit, sub, following)
            return answer if bit > 8 or sub else None

    line = Line(AnswersOn(1, 2, 3, 4), Liar(0x8000_0000, 2, 3, 4))
    found = scan(line)
    assert ids(found) == [(1, 2, 3, 4)]
    assert "a slave there was possibly not found" in found.incomplete
    assert "0x80000000 0x0 0x0 0x0 to 0xFFFFFFFF 0xFFFFFFFF 0xFFFFFFFF 0xFFFFFFFF" in found.incomplete
    assert line.now < 240.0


def test_the_most_that_are_wanted_are_not_exceeded() -> None:
    line = Line(*(AnswersOn(1, 2, 3, serial) for serial in range(4)))
    found: Scanned = line.run(FastScan(AdaptiveLssTimeout(), most=2).run())
    assert len(found.slaves) == 2


@pytest.mark.parametrize("stack", STACKS)
def test_such_a_slave_is_given_a_node_id_by_the_address_that_was_found(stack: type[HandSlave]) -> None:
    slave, other = stack(1, 2, 3, 4), stack(1, 2, 3, 5)
    line = Line(slave, other)
    for each, node_id in zip(scan(line).slaves, (11, 12), strict=True):
        line.run(master.set_node_id(AdaptiveLssTimeout(), each.address, node_id, store=True))
    assert (slave.active, other.active, slave.stored, other.stored) == (11, 12, [11], [12])


def test_the_branches_of_the_tree() -> None:
    leaf = of(LssAddress(0x80000000, 1, 0, 0xFFFFFFFF))
    low, high = ROOT.children
    assert (leaf.depth, leaf.sub, leaf.bit_check, leaf.address.parts) == (
        DEPTH,
        3,
        0,
        (0x80000000, 1, 0, ONES),
    )
    assert (low.sub, low.bit_check, low.numbers[0], high.numbers[0]) == (0, 31, 0, 0x80000000)
    assert (low.holds(leaf.address), high.holds(leaf.address), ROOT.holds(leaf.address)) == (
        False,
        True,
        True,
    )
    assert high.within((0xFFFFFFFF, None, None, None))
    assert not high.within((1, None, None, None))
    part = ROOT.with_part(0x80000000)
    assert (part.depth, part.sub, part.bit_check, part.holds(leaf.address)) == (32, 0, 0, True)
    assert part.children[0].sub == 1
