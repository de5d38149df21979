"""Captures that wait for an edge of an input, for its value, or for a latched position of a touch probe."""

from __future__ import annotations

import pytest

from axisbus.cia301.frame import CanFrame
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia301.pdo import PdoLocation
from axisbus.cia401.port import SignalValidity
from axisbus.cia401.signal import IoPoint
from axisbus.errors import ArgumentError
from axisbus.motion.io import IoReading
from axisbus.record.load import load
from axisbus.record.objects import MappedSignal, WantedObject
from axisbus.record.triggers import IoTrigger
from kit.cell import SCALE, Stage, cell_text
from kit.io_module import LEVEL, MODULE

pytest.importorskip("mcap")
PERIOD = 0.01


@pytest.fixture
def cell(tmp_path):
    with Stage(tmp_path) as stage:
        yield stage.simulated(text=cell_text("x", more=MODULE.format(node='on_lost = "report"') + LEVEL))


def wired(cell):
    return cell.machine.simulated_node(5).device.io


def moment(run) -> float:
    """The time of the moment, of the recording."""
    (event,) = [event for event in run.events if event.text.startswith("the moment")]
    return event.time


@pytest.mark.parametrize(
    ("when", "at"), [("part = true", 2), ("part = false", 4), ("part == TRUE", 2), ("part != true", 4)]
)
def test_an_edge_of_an_input_is_the_moment(cell, tmp_path, when, at):
    path, machine = tmp_path / "moment.mcap", cell.machine
    with machine.capture(path, when, before=0.1, after=0.2) as capture:
        for step in range(1, 6):
            machine.sleep(0.3)
            assert capture.fired == (step > at)
            wired(cell).set_bit(0x6000, 1, 2, step in (2, 3))
        assert capture.wait(1.0)
    run = load(path)
    assert moment(run) == pytest.approx(0.1, abs=PERIOD)
    assert run.seconds == pytest.approx(0.3, abs=2 * PERIOD)
    assert [event.text for event in run.events if "moment" in event.text] == [f"the moment: {when}"]


def test_a_signal_that_is_true_from_the_beginning_is_no_edge(cell, tmp_path):
    wired(cell).set_bit(0x6000, 1, 2, True)
    cell.machine.sleep(0.1)
    with cell.machine.capture(tmp_path / "none.mcap", "part = true") as capture:
        cell.machine.sleep(0.5)
        assert not capture.fired


def test_a_capture_is_triggered_by_a_limit_in_the_unit_of_the_value(cell, tmp_path):
    machine = cell.machine
    with machine.capture(tmp_path / "moment.mcap", "level >= 2.5", before=0.1, after=0.1) as capture:
        for raw in (100, 349):
            wired(cell).set(0x6401, 2, raw)
            machine.sleep(0.2)
            assert not capture.fired
        wired(cell).set(0x6401, 2, 350)
        assert capture.wait(1.0)


def test_an_output_that_is_set_is_a_moment(cell, tmp_path):
    with cell.machine.capture(tmp_path / "moment.mcap", "lamp = true", after=0.1) as capture:
        cell.machine.sleep(0.1)
        cell.machine.io["lamp"].set(True).wait(1.0)
        assert capture.wait(1.0)


def test_an_input_that_returns_with_another_value_has_no_edge(cell, tmp_path):
    machine = cell.machine
    with machine.capture(tmp_path / "moment.mcap", "part = true", after=0.1) as capture:
        machine.sleep(0.1)
        cell.nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 5)
        machine.sleep(0.5)
        wired(cell).set_bit(0x6000, 1, 2, True)
        cell.nmt(NmtCommand.START, 5)
        machine.sleep(0.5)
        assert machine.io["part"].value is True
        assert not capture.fired
        wired(cell).set_bit(0x6000, 1, 2, False)
        machine.sleep(0.1)
        wired(cell).set_bit(0x6000, 1, 2, True)
        assert capture.wait(1.0)


def test_an_edge_latched_by_a_touch_probe_is_a_moment_and_an_old_edge_is_not(cell, tmp_path):
    x, machine, path = cell.x, cell.machine, tmp_path / "moment.mcap"
    x.enable().wait(5)
    cell.drive().touch_probe.put_mark(1, 20 * SCALE, 40 * SCALE)
    old = x.probe()
    old.wait_armed(1.0)
    x.move_absolute(50.0).wait(5)
    assert old.done
    with machine.capture(path, "x.probe", before=0.1, after=0.1) as capture:
        machine.sleep(0.3)
        x.move_absolute(0.0).wait(5)  # over the mark, but without a request
        assert not capture.fired
        found = x.probe_move(30.0, velocity=60.0)
        assert capture.wait(5.0)
    run = load(path)
    track = run.tracks["x"]
    at = min(range(len(track.times)), key=lambda n: abs(track.times[n] - moment(run)))
    assert 20.0 < track.columns["position"][at] < 20.0 + 60.0 * 0.1
    assert moment(run) == pytest.approx(0.1, abs=PERIOD)
    assert found.wait(5).position == pytest.approx(20.0, abs=0.01)


@pytest.mark.parametrize(
    ("when", "text"),
    [
        ("door = true", "there is no input or output 'door'"),
        ("part > true", "cannot be compared"),
        ("part = open", "cannot be compared"),
        ("level > high", "cannot be compared"),
        ("z.probe", "there is no axis 'z'"),
        ("x.probe = 3", "there is no value 'probe'"),
        ("part rises", "is not a condition"),
    ],
)
def test_an_invalid_moment_is_refused_at_the_call(cell, tmp_path, when, text):
    with pytest.raises(ArgumentError, match=text) as told:
        cell.machine.capture(tmp_path / "none.mcap", when)
    assert "door" not in when or "it has" in told.value.observed or "part" in told.value.observed


def test_a_cell_continues_when_its_capture_ends_without_a_moment(cell, tmp_path):
    for when in ("part = true", "x.probe"):
        with cell.machine.capture(tmp_path / "none.mcap", when) as capture:
            cell.machine.sleep(0.1)
        assert not capture.fired
        assert not (tmp_path / "none.mcap").exists()
    wired(cell).set_bit(0x6000, 1, 2, True)
    cell.machine.sleep(0.1)


# -- frames, by hand ---------------------------------------------------------------------------------------------------


class Frames:
    """A core that reports frames of a bus, and the known state of an input after each cycle."""

    carried = object()

    def __init__(self):
        self.taps, self.readings = {}, {}
        self.place = PdoLocation(0x185, "TPDO1", 0, 8)

    def tap(self, hear, can_ids=()):
        self.taps[hear] = tuple(can_ids)

    def untap(self, hear):
        del self.taps[hear]

    def knows(self, value: int | None, now: float = 0.0) -> None:
        known = SignalValidity.YES if value is not None else SignalValidity.NOT_BOOTED
        self.readings = {"part": IoReading(now, known, value, now)}

    def comes(self, *frames: tuple[float, int]) -> None:
        for hear in self.taps:
            hear([CanFrame(time, 0x185, bytes([value])) for time, value in frames])


def watching(known: int | None) -> tuple[Frames, IoTrigger]:
    session = Frames()
    session.knows(known)
    wanted = WantedObject(
        "part", 5, 0x6000, 1, "part", None, IoPoint("part", 5, 0x6000, 1, 8, False, output=False, bit=2)
    )
    moment = IoTrigger(
        session, wanted, lambda: MappedSignal(wanted, session.place), lambda value: value is True
    )
    moment.begin()
    return session, moment


def test_an_input_that_a_boot_up_maps_to_another_place_is_found_there():
    session, moment = watching(0)
    session.place = PdoLocation(0x185, "TPDO1", 8, 8)
    assert moment.seen(1.0, {}) is None
    session.comes((1.1, 4))  # another object is there now, and the frame is too short
    assert moment.seen(1.2, {}) is None
    for hear in session.taps:
        hear([CanFrame(time, 0x185, bytes([0, value])) for time, value in ((1.3, 0), (1.4, 4))])
    assert moment.seen(1.5, {}) == 1.4
    moment.end()
    assert not session.taps


def test_an_edge_has_the_time_of_its_frame_and_waits_for_its_cycle():
    session, moment = watching(0)
    assert list(session.taps.values()) == [(0x185,)]
    session.comes((1.001, 0), (1.012, 4), (1.021, 0))
    session.knows(0)
    assert moment.seen(1.010, {}) is None
    assert moment.seen(1.020, {}) == 1.012
    assert moment.seen(1.030, {}) is None
    session.comes((1.5, 0xFB))  # all others
    assert moment.seen(1.6, {}) is None
    moment.end()
    moment.end()
    assert session.taps == {}


@pytest.mark.parametrize("known", [1, None])
def test_the_first_value_of_an_input_is_no_edge_if_it_was_so_or_unknown(known):
    session, moment = watching(known)
    session.comes((1.0, 4))
    assert moment.seen(1.1, {}) is None
    session.comes((1.2, 0), (1.3, 4))
    session.knows(1)
    assert moment.seen(1.4, {}) == 1.3


def test_a_frame_after_the_node_was_lost_is_no_edge():
    session, moment = watching(0)
    session.comes((1.0, 0))
    session.knows(None)
    assert moment.seen(1.5, {}) is None
    session.comes((2.0, 4))
    session.knows(1)
    assert moment.seen(2.1, {}) is None


def test_on_change_alone_the_first_frame_is_the_edge():
    session, moment = watching(0)
    assert moment.seen(2.9, {}) is None
    session.comes((3.0, 4))
    assert moment.seen(3.1, {}) == 3.0


def test_an_edge_before_the_first_stored_cycle_is_no_moment():
    session, moment = watching(0)
    session.comes((3.0, 4))
    session.knows(1)
    assert moment.seen(3.02, {}) is None
    session.comes((3.1, 0), (3.2, 4))
    assert moment.seen(3.21, {}) == 3.2
