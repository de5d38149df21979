"""Block transfers of 64 KiB, read and written, with single frames of either side lost once.

In all 74 blocks frames at the same places are lost, in the last blocks every frame; ``make explore`` loses every one of all.
"""

from __future__ import annotations

import functools
import os
import random

import pytest

from axisbus.cia301.sdo import SdoTransferType
from kit.sim.sdo_sweep import Sweep
from kit.sim.sdo_wire import SdoWire

BIG = random.Random(301).randbytes(65536)
PARTS = 6
# 9363 segments of 7 octets in 74 blocks, each confirmed; the initiation and its answer; the end and its answer; reading has one
# frame more, the client's start (CiA 301 7.2.4.3.8 to 7.2.4.3.15; counted by hand).
FRAMES = {False: 9363 + 74 + 5, True: 9363 + 74 + 4}
BLOCK = 128  # its segments and their confirmation
# Places within a block, which recover alike in every block: around both of its ends, and some between.
PLACES = frozenset({0, 1, 2, 3, 5, 17, 40, 64, 90, 111, 125, 126, 127})
ALL_FROM = 9442 - 2 * BLOCK  # from here the recovery is another one
EVERY_FRAME = os.environ.get("AXISBUS_EXAMPLES") == "fresh"

sweep_of_64_kib = functools.cache(functools.partial(Sweep, BIG))


@pytest.mark.timeout(300)
@pytest.mark.parametrize("part", range(PARTS, 0, -1))
@pytest.mark.parametrize("writing", [False, True], ids=["reading", "writing"])
def test_frames_of_64_kib_lost_once(writing, part):
    """From the end backwards, so that the rest of a transfer is already known."""
    sweep = sweep_of_64_kib(writing)
    assert sweep.frames == FRAMES[writing]
    numbers = range(sweep.frames * part // PARTS, sweep.frames * (part - 1) // PARTS, -1)
    lost = [number for number in numbers if _is_lost(number)]
    assert len(lost) >= len(numbers) // BLOCK * len(PLACES)
    assert sweep.lose(lost) > 100 * len(lost)


def _is_lost(number: int) -> bool:
    return EVERY_FRAME or number > ALL_FROM or number % BLOCK in PLACES


@pytest.mark.parametrize("tries", [1, 2])
@pytest.mark.parametrize("writing", [False, True], ids=["reading", "writing"])
def test_the_sweep_finds_the_same_losses_as_whole_transfers(writing, tries):
    """The oracle of the sweep itself: with one attempt only some losses end a transfer, and it must name just those."""
    data = BIG[:3000]
    sweep = Sweep(data, writing, tries)
    found = {number for number in range(sweep.frames, 0, -1) if _ends_badly(sweep, number)}
    expected = {number for number in range(1, sweep.frames + 1) if _fails(data, writing, tries, number)}
    assert found == expected
    assert bool(found) == (tries == 1)


def _ends_badly(sweep: Sweep, number: int) -> bool:
    try:
        sweep.lose([number])
    except AssertionError:
        return True
    return False


def _fails(data: bytes, writing: bool, tries: int, lost: int) -> bool:
    wire = SdoWire(b"old" if writing else data)
    wire.fate = lambda number, _: None if number == lost else 0.0
    session = (
        wire.download(data, SdoTransferType.BLOCK, tries)
        if writing
        else wire.upload(SdoTransferType.BLOCK, tries)
    )
    return session.failure is not None
