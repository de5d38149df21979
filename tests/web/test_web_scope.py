"""The scope's batches: every cycle once and in order, lost ones are counted, unknown values are no number, rights."""

from __future__ import annotations

import json
import math
import sys
import threading
from array import array

import pytest

pytest.importorskip("nicegui", reason="the page needs nicegui")

from axisbus.machine.machine import Machine
from axisbus.web.page_socket import HEAD, batch
from axisbus.web.scope.signals import MAX_SIGNALS, Choice, ScopeBuffer, SignalReader, read, signals_of
from kit import command_line


def opened(data):
    """A batch as a page reads it."""
    choice, samples, signals, lost = HEAD.unpack_from(data)
    times = array("d", data[HEAD.size : HEAD.size + 8 * samples])
    rest = array("f", data[HEAD.size + 8 * samples :])
    assert len(rest) == samples * signals
    return choice, lost, list(times), [list(rest[k * samples : (k + 1) * samples]) for k in range(signals)]


@pytest.fixture(scope="module")
def seen():
    """The images of a simulated cell while an axis moves, with the parameters and the values of its axis at each."""
    found, told = [], []
    with Machine.simulated(command_line.CELL) as machine:
        x = machine["x"]
        x.enable().wait(5)
        machine.session.observe(lambda now, images: found.append((now, dict(images))))
        handle = x.move_relative(20.0)
        while not handle.done:
            machine.sleep(0.05)
            told.append((x.snapshot.now, x.position, x.velocity))
        facts = machine.session.axes
        parameters = {name: facts[name].parameters for name in facts}
    return found, told, parameters


def test_each_axis_has_its_numbers_with_units_and_words(seen):
    _, _, parameters = seen
    found = {each.name: each for each in signals_of("x", parameters["x"])}
    assert set(found) == {
        f"x.{name}" for name in ("position", "velocity", "torque", "target", "demand", "following_error")
    }
    assert (found["x.position"].unit, found["x.velocity"].unit) == ("deg", "deg/s")
    assert all(each.text for each in found.values())


def test_a_batch_has_every_cycle_with_the_values_that_the_axis_had(seen):
    found, told, parameters = seen
    cycles = ScopeBuffer()
    for now, images in found:
        cycles.add(now, images)
    fetched = cycles.since(0, 10_000)
    assert (len(fetched.cycles), fetched.lost, fetched.next) == (len(found), 0, len(found))
    reader = SignalReader(("x.velocity", "x.position"), parameters)
    choice, lost, times, (velocity, position) = opened(batch(7, fetched.cycles, reader, 3))
    assert (choice, lost, times) == (7, 3, [now for now, _ in found])
    at = {now: place for place, now in enumerate(times)}
    compared = [
        (position[at[now]], place, velocity[at[now]], speed) for now, place, speed in told if now in at
    ]
    assert len(compared) > 5
    for drawn, place, drawn_speed, speed in compared:
        assert drawn == pytest.approx(place, abs=1e-3)
        assert drawn_speed == pytest.approx(speed, abs=1e-3)
    assert max(velocity) > 10.0


def test_an_unknown_value_is_no_number(seen):
    found, _, parameters = seen
    now, images = found[0]
    cycles = ScopeBuffer()
    cycles.add(now, {**images, "x": images["x"]._replace(velocity=None)})
    cycles.add(now + 0.01, {name: image for name, image in images.items() if name != "x"})
    reader = SignalReader(("x.position", "x.velocity"), parameters)
    _, _, _, (position, velocity) = opened(batch(0, cycles.since(0, 9).cycles, reader, 0))
    assert [math.isnan(each) for each in position] == [False, True]
    assert [math.isnan(each) for each in velocity] == [True, True]


def test_a_slow_reader_gets_the_remaining_cycles_and_the_number_of_lost_ones():
    cycles = ScopeBuffer(max_cycles=10)
    for number in range(25):
        cycles.add(number / 1000, {})
    first = cycles.since(3, 4)
    assert ([each.number for each in first.cycles], first.lost, first.next) == ([15, 16, 17, 18], 12, 19)
    second = cycles.since(first.next, 100)
    assert ([each.number for each in second.cycles], second.lost, second.next) == ([*range(19, 25)], 0, 25)
    assert cycles.since(25, 100) == ((), 0, 25)
    assert ScopeBuffer().since(0, 5) == ((), 0, 0)


def test_cycles_added_during_a_read_are_neither_lost_nor_doubled():
    cycles, over, found, lost, at = ScopeBuffer(max_cycles=500), threading.Event(), [], 0, 0

    def add():
        for number in range(30_000):
            cycles.add(float(number), {})
        over.set()

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    adding = threading.Thread(target=add)
    adding.start()
    try:
        while True:
            last = over.is_set()
            fetched = cycles.since(at, 200)
            found += [each.number for each in fetched.cycles]
            lost, at = lost + fetched.lost, fetched.next
            if last and not fetched.cycles:
                break
    finally:
        sys.setswitchinterval(before)
        adding.join()
    assert found == sorted(set(found))
    assert len(found) + lost == 30_000


THERE = {"x.position", "x.velocity"}


@pytest.mark.parametrize(
    "message",
    [
        "",
        "{",
        "[]",
        "null",
        '{"choice": 1}',
        '{"choice": true, "signals": []}',
        '{"choice": -1, "signals": []}',
        '{"choice": 4294967296, "signals": []}',
        '{"choice": 1, "signals": "x.position"}',
        '{"choice": 1, "signals": ["x.password"]}',
        '{"choice": 1, "signals": [1]}',
        json.dumps({"choice": 1, "signals": ["x.position"] * (MAX_SIGNALS + 1)}),
        json.dumps({"choice": 1, "signals": [], "more": "x" * 5000}),
        "[" * 3000,
    ],
)
def test_an_invalid_message_selects_no_signals(message):
    assert read(message, THERE) is None


def test_a_choice_names_signals_once():
    assert read('{"choice": 4, "signals": ["x.velocity", "x.velocity"]}', THERE) == Choice(4, ("x.velocity",))
    assert read('{"choice": 0, "signals": []}', THERE) == Choice(0, ())
