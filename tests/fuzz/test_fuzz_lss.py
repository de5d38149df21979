"""The LSS master against slaves that answer anything, at any time: every dialogue ends, by a result or by one clear error."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia305 import master
from axisbus.cia305.dialogue import AdaptiveLssTimeout, LssReplies, LssReply, LssRequest, LssTiming
from axisbus.cia305.fastscan import FastScan, KnownIdentity
from axisbus.cia305.services import LssAddress
from axisbus.errors import LssError, LssTimeout

CEILING = 0.5  # s
ADDRESS = LssAddress(0xC0B00, 8, 0x10002, 4711)
# a scan of three slaves with every search begun again, and every bit asked as often as may be
MOST_ASKS = 20_000

# One answer: the bytes behind its command specifier, and its time as a part of the wait.
saying = st.binary(max_size=7) | st.integers(0, 255).map(lambda node: bytes([node]).ljust(7, b"\0"))
said = st.tuples(saying, st.floats(0.0, 1.0))
turns = st.tuples(st.lists(said, max_size=3), st.lists(st.floats(0.0, 100.0), max_size=2))
dialogues: dict[str, Callable[[AdaptiveLssTimeout], Any]] = {
    "fast scan": lambda pace: FastScan(pace, most=3).run(),
    "fast scan of a known maker": lambda pace: FastScan(pace, KnownIdentity(vendor_id=0xC0B00), most=3).run(),
    "inquire": lambda pace: master.inquire(pace, ADDRESS),
    "inquire the only one": lambda pace: master.inquire(pace, None),
    "set node-ID": lambda pace: master.set_node_id(pace, ADDRESS, 5, store=True),
    "set bit rate of all": lambda pace: master.set_bit_rate(pace, None, 500_000, store=True),
    "set bit rate": lambda pace: master.set_bit_rate(pace, [ADDRESS], 500_000, store=False),
    "store": lambda pace: master.store(pace, None),
    "activate": lambda pace: master.activate(pace, [ADDRESS], 0.1),
    "identify": lambda pace: master.identify(pace, ADDRESS, ADDRESS),
    "any unconfigured": lambda pace: master.any_unconfigured(pace),
}


def heard(ask: LssRequest, turn: tuple[list[tuple[bytes, float]], list[float]]) -> LssReplies:
    answers, late = turn
    if ask.expects is None:
        return LssReplies((), tuple(late))
    first = bytes([ask.expects])
    times = sorted(part for _, part in answers)
    # The first comes within the wait, the others in the time that is listened to behind it, as ``bus.lss`` takes them.
    delays = [times[0] * ask.wait + ask.settle * part * bool(number) for number, part in enumerate(times)]
    made = tuple(
        LssReply(first + data, delay) for (data, _), delay in zip(answers, sorted(delays), strict=True)
    )
    return LssReplies(made, tuple(late))


def run(
    dialogue: Generator[LssRequest, LssReplies, Any], take: Callable[[int, LssRequest], LssReplies]
) -> tuple[Any, int]:
    """Run a dialogue; return its result, or its error, and how many frames it sent."""
    count = 0
    try:
        ask = next(dialogue)
        while True:
            assert len(ask.frame) == 8
            assert ask.settle <= CEILING
            assert ask.wait <= max(8 * CEILING, master.STORE_WAIT)
            count += 1
            assert count < MOST_ASKS, "there is no end to it"
            ask = dialogue.send(take(count, ask))
    except StopIteration as end:
        return end.value, count
    except LssError as error:
        return error, count


@given(st.sampled_from(sorted(dialogues)), st.lists(turns, min_size=1, max_size=6))
@settings(max_examples=250)
def test_an_lss_dialogue_ends_for_any_answers(name, script):
    dialogue = dialogues[name](AdaptiveLssTimeout(LssTiming(ceiling=CEILING)))
    result, _ = run(dialogue, lambda count, ask: heard(ask, script[count % len(script)]))
    if isinstance(result, master.Inquired):
        assert result.node_id is None or result.node_id in {*range(1, 128), 255}


def chatter(ask: LssRequest) -> LssReplies:
    """A slave that answers twice, the second time as late as is still listened to."""
    if ask.expects is None:
        return LssReplies()
    first = bytes([ask.expects]).ljust(8, b"\0")
    return LssReplies((LssReply(first, 0.001), LssReply(first, 0.001 + ask.settle)))


def test_a_slave_that_continues_talking_does_not_slow_the_scan_down_for_ever():
    pace = AdaptiveLssTimeout(LssTiming(ceiling=CEILING))
    settles: list[float] = []

    def take(_: int, ask: LssRequest) -> LssReplies:
        settles.append(ask.settle)
        return chatter(ask)

    run(FastScan(pace, most=3).run(), take)
    assert max(settles) == CEILING


@pytest.mark.parametrize("told", [0, 128, 200, 254])
def test_an_impossible_node_id_is_refused(told):
    """0 would be all nodes in the NMT command that a new node-ID may need."""

    def take(_: int, ask: LssRequest) -> LssReplies:
        if ask.expects is None:
            return LssReplies()
        number = ADDRESS.serial_number if ask.expects == 0x5D else told
        return LssReplies((LssReply(bytes([ask.expects]) + number.to_bytes(4, "little") + bytes(3), 0.001),))

    result, _ = run(master.inquire(AdaptiveLssTimeout(), ADDRESS), take)
    assert result == master.Inquired(ADDRESS, None)
    assert not result.configured


@pytest.mark.parametrize("cut", [b"", b"\0"])
def test_an_answer_that_is_cut_short_confirms_nothing(cut):
    def take(_: int, ask: LssRequest) -> LssReplies:
        if ask.expects is None:
            return LssReplies()
        whole = ADDRESS.serial_number.to_bytes(4, "little") if ask.expects == 0x5D else b"\xff\0"
        return LssReplies((LssReply(bytes([ask.expects]) + (cut if ask.expects == 0x11 else whole), 0.001),))

    result, _ = run(master.set_node_id(AdaptiveLssTimeout(), ADDRESS, 5, store=False), take)
    assert isinstance(result, LssTimeout)
    assert "configure node-ID" in str(result)
