"""The timetable of a cycle, against a wire on which its frames are let loose together, with whatever stuff bits they have."""

from __future__ import annotations

import heapq
import random
from dataclasses import replace

import pytest

from axisbus.cell import reader
from axisbus.check.cycle_schedule import CycleSlot, Timetable, shortest, timetable
from axisbus.check.scan_period_advice import changes
from axisbus.core.files import load_dictionaries
from kit.cell import cell_file

MBIT = 1_000_000


def made(tmp_path, names="xyz", **given):
    path = cell_file(tmp_path, names, bus="bitrate = 1_000_000", **given)
    cell = reader.load(path)
    return cell, load_dictionaries(cell)


def arbitrate(frames, blocking):
    """When each frame is through, in bits: ``frames`` are (released, identifier, bits); ``blocking``: the wire is taken first."""
    waiting, through, now = [], {}, blocking
    pending = sorted(frames)
    while pending or waiting:
        while pending and pending[0][0] <= now:
            _, can_id, bits = pending.pop(0)
            heapq.heappush(waiting, (can_id, bits))
        if not waiting:
            now = pending[0][0]
            continue
        can_id, bits = heapq.heappop(waiting)
        now += bits
        through[can_id] = now
    return through


@pytest.mark.parametrize("names", ["x", "xyz", "abcdefgh"])
def test_no_frame_is_later_than_in_the_table(tmp_path, names):
    cell, files = made(tmp_path, names)
    table = timetable(cell, files, MBIT)
    assert [slot.kind for slot in table.slots[:2]] == ["SYNC", "TPDO"]
    assert len({slot.can_id for slot in table.slots}) == len(table.slots)
    chance = random.Random(1)
    for _ in range(200):
        # A drive is never earlier than SYNC, which itself waits for a frame in transmission; stuff bits are random.
        frames = [
            (
                0 if slot.kind == "SYNC" else 1,
                slot.can_id,
                chance.randrange(47 + 8 * slot.data_bytes, slot.bits + 1),
            )
            for slot in table.slots
            if chance.random() < 0.95
        ]
        through = arbitrate(frames, chance.randrange(136))
        assert all(
            through[slot.can_id] <= round(slot.end * MBIT) for slot in table.slots if slot.can_id in through
        )


def test_the_worst_case_is_reached(tmp_path):
    cell, files = made(tmp_path)
    table = timetable(cell, files, MBIT)
    through = arbitrate([(0, slot.can_id, slot.bits) for slot in table.slots], 135)
    assert through == {slot.can_id: round(slot.end * MBIT) for slot in table.slots}
    assert table.waits == pytest.approx(135e-6)


def test_the_shortest_period_fits_and_one_step_less_does_not(tmp_path):
    cell, files = made(tmp_path)
    for rate in (MBIT, 500_000, 125_000):
        least = shortest(cell, files, rate)
        with_period = [
            replace(cell, bus=replace(cell.bus, scan_period=period)) for period in (least, least - 0.0001)
        ]
        assert [timetable(one, files, rate).fits for one in with_period] == [True, False]
    assert shortest(cell, files, MBIT) < shortest(cell, files, 500_000) < shortest(cell, files, 125_000)


def test_a_bus_that_nothing_helps_has_no_period(tmp_path):
    cell, files = made(tmp_path)
    assert shortest(cell, files, 1000) is None


def test_changes_that_help_are_listed_with_the_best_first(tmp_path):
    cell, files = made(tmp_path)
    now = shortest(cell, files, 250_000)
    found = changes(cell, files, 250_000)
    assert found
    assert [change.period for change in found] == sorted(change.period for change in found)
    assert all(change.period < now for change in found)
    assert any("bitrate = 1_000_000" in change.what for change in found)
    assert any("a second bus; this one keeps nodes 1, 2" in change.what for change in found)


def test_a_remote_request_takes_the_wire_as_well(tmp_path):
    cell, files = made(
        tmp_path, "x", more='[nodes.1.pdo.tpdo2]\nmap = ["6064"]\ntransmission = 253\nrtr = "40ms"\n'
    )
    slots = timetable(cell, files, MBIT).slots
    asked = [slot for slot in slots if slot.kind == "request"]
    assert [(slot.name, slot.data_bytes, slot.share) for slot in asked] == [("TPDO2", 0, 0.25)]


def test_identifiers_of_29_bits_lose_arbitration_against_equal_ones_of_11_bits():
    ids = [0x181, 0x181 << 18, (0x181 << 18) + 1, 0x182]
    slots = [CycleSlot(can_id, "TPDO", 1, "TPDO1", (), 8) for can_id in reversed(ids)]
    assert [slot.can_id for slot in sorted(slots, key=lambda slot: slot.rank)] == ids
    assert slots[-1].bits < slots[-2].bits


def test_a_table_without_frames_takes_nothing():
    table = Timetable(MBIT, 0.004, ())
    assert (table.fullest, table.load, table.fits) == (0.0, 0.0, True)


def test_without_velocity_and_torque_their_targets_do_not_travel(tmp_path):
    all_modes, files = made(tmp_path)
    by_position, _ = made(tmp_path, axis='modes = ["pp", "hm", "csp"]')
    sent = [
        {slot.name for slot in timetable(cell, files, MBIT).slots if slot.kind == "RPDO"}
        for cell in (all_modes, by_position)
    ]
    assert sent == [{"RPDO1", "RPDO2"}, {"RPDO1"}]
    assert any(
        'modes = ["pp", "hm", "csp"] in each axis' in change.what
        for change in changes(all_modes, files, MBIT)
    )
    assert not any("modes = " in change.what for change in changes(by_position, files, MBIT))
