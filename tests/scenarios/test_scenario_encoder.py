"""An encoder axis: a count of an I/O module is the position of an axis without a drive, and other axes follow it."""

from __future__ import annotations

import math

import pytest

from axisbus.cell import reader
from axisbus.check.run import check
from axisbus.cia301.nmt import NmtCommand
from axisbus.errors import AxisbusError, ConfigError, StaleError
from axisbus.motion.states import AxisState
from kit.cell import Cell, cell_file, cell_text
from kit.plant_probe import ENABLED

COUNTS = 20.0  # per mm
BELT = """
[nodes.5]
eds = "builtin:generic-cia401"
{node}
[io.count]
node = 5
object = "6401h:01"
[axes.belt]
encoder = "count"
unit = "mm"
scale = 20
"""
RAMP = 500.0  # deg/s², the default of x


class Belt:
    """A belt that moves at ``speed`` (mm/s) as its counter shows; ``place`` in mm."""

    def __init__(self, cell: Cell, speed: float = 0.0, begin: float = 0.0) -> None:
        self.cell, self.speed, self.place = cell, speed, begin
        self._counter = cell.machine.simulated_node(5).device.io
        self._last = cell.now
        cell.each_cycle(self._go)

    def _go(self, now: float, _: object) -> None:
        self.place += self.speed * (now - self._last)
        self._last = now
        raw = math.floor(self.place * COUNTS)
        self._counter.set(0x6401, 1, (raw + (1 << 15)) % (1 << 16) - (1 << 15))


def belt_and_axis(
    scenario, speed: float = 0.0, begin: float = 0.0, node: str = "", **changes
) -> tuple[Cell, Belt]:
    cell = scenario.simulated(text=cell_text("x", more=BELT.format(node=node), **changes))
    belt = Belt(cell, speed, begin)
    cell.x.enable().wait(5)
    cell.run(0.1)
    return cell, belt


def test_the_position_of_an_encoder_axis_is_its_count_in_its_unit(scenario):
    cell, belt = belt_and_axis(scenario, begin=12.3)
    assert cell["belt"].position == pytest.approx(12.3, abs=1 / COUNTS)
    assert cell["belt"].state is AxisState.DISABLED
    belt.speed = -40.0
    cell.run(1.0)
    assert cell["belt"].position == pytest.approx(belt.place, abs=2.0)


def test_an_encoder_axis_counts_past_the_end_of_its_input(scenario):
    """16 bits hold 3,276 mm."""
    cell, belt = belt_and_axis(scenario, speed=2000.0)
    cell.run(5.0)
    belt.speed = 0.0
    cell.run(0.2)
    assert belt.place > 10_000.0
    assert cell["belt"].position == pytest.approx(belt.place, abs=1 / COUNTS)


def test_an_axis_is_synchronised_with_a_moving_encoder_axis_without_vibration(scenario):
    cell, belt = belt_and_axis(scenario, speed=100.0)
    gear = cell.x.gear_in(cell["belt"], 0.5)
    gear.wait(5)
    cell.run(2.0)
    before, moment = belt.place, cell.moment()
    x = cell.where("x")
    cell.run(2.0)
    assert cell.where("x") - x == pytest.approx(0.5 * (belt.place - before), abs=0.3)
    assert cell.hardest_change(since=moment) < 0.3 * RAMP
    belt.speed = 0.0
    cell.must_be_still(within=2.0, stages=ENABLED)


def test_a_sync_position_of_an_encoder_axis_is_met(scenario):
    cell, belt = belt_and_axis(scenario, speed=50.0)
    at = belt.place + 150.0
    cell.x.gear_in(cell["belt"], 1.0, sync_positions=(at, 20.0), master_start_distance=60.0).wait(10)
    cell.run(0.5)
    path = cell.core("x").active_path
    assert path is not None
    # The target takes effect with the next SYNC, with which the counter is sampled as it is now.
    assert path.last_step.position - 20.0 == pytest.approx(belt.place - at, abs=2 / COUNTS)


@pytest.mark.parametrize("how", ["dead", "nmt"])
def test_a_dead_encoder_brakes_its_slave_and_the_error_names_it(scenario, how):
    cell, _belt = belt_and_axis(scenario, speed=100.0, node='on_lost = "report"')
    cell.x.gear_in(cell["belt"], 0.5).wait(5)
    cell.run(0.5)
    moment, device = cell.moment(), cell.machine.simulated_node(5).device
    if how == "dead":
        device.dials.dead = True
    else:
        device.nmt_command(NmtCommand.STOP)
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 3.0)
    cell.must_be_still(within=1.5, stages=ENABLED)
    assert cell.hardest_change(since=moment) < 2.1 * RAMP
    error = cell.x.error
    assert error is not None
    assert "belt" in str(error)
    with pytest.raises(StaleError):
        _ = cell["belt"].position


def test_by_default_a_dead_encoder_stops_the_cell(scenario):
    cell, _ = belt_and_axis(scenario, speed=100.0)
    cell.x.gear_in(cell["belt"], 0.5).wait(5)
    cell.machine.simulated_node(5).device.dials.dead = True
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 3.0)
    cell.must_be_still(within=1.5, stages=ENABLED)


@pytest.mark.parametrize(
    "command",
    [
        lambda belt: belt.enable(),
        lambda belt: belt.move_absolute(1.0, velocity=1.0, acceleration=1.0, deceleration=1.0),
        lambda belt: belt.move_velocity(1.0, acceleration=1.0, deceleration=1.0),
        lambda belt: belt.home(35),
    ],
)
def test_no_command_moves_an_encoder_axis(scenario, command):
    cell, _ = belt_and_axis(scenario)
    with pytest.raises(AxisbusError):
        command(cell["belt"]).wait(2)
    assert cell["belt"].state is AxisState.DISABLED


def test_stops_of_an_encoder_axis_are_done_at_once_and_its_position_can_be_set(scenario):
    cell, belt = belt_and_axis(scenario, begin=30.0)
    for name in ("halt", "stop", "quick_stop", "disable", "reset"):
        getattr(cell["belt"], name)().wait(1)
    cell["belt"].set_position(100.0).wait(2)
    assert cell["belt"].position == pytest.approx(100.0, abs=1 / COUNTS)
    belt.speed = 10.0
    cell.run(1.0)
    assert cell["belt"].position == pytest.approx(70.0 + belt.place, abs=0.5)


def test_an_override_of_the_cell_does_not_affect_an_encoder_axis(scenario):
    cell, _ = belt_and_axis(scenario, speed=40.0)
    assert cell.end_of(cell.machine.set_override(0.5)) is None
    cell.x.gear_in(cell["belt"], 0.5).wait(5)
    cell.run(0.5)
    assert cell.speed() == pytest.approx(20.0, rel=0.1)


def test_leaving_the_machine_does_nothing_to_it(scenario):
    cell, _ = belt_and_axis(scenario, speed=100.0)
    cell.machine.close()


def written(tmp_path, text: str):
    return cell_file(tmp_path, "x", more=text)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("scale = 20", ""), "scale"),
        (("scale = 20", "scale = 20\nmax_velocity = 3.0"), "cannot be in [axes.belt], an encoder"),
        (("scale = 20", "scale = 20\n[axes.belt.defaults]\nvelocity = 1.0"), "an encoder"),
        (('encoder = "count"', "encoder = 3"), "encoder"),
    ],
)
def test_an_invalid_key_of_an_encoder_axis_is_reported(tmp_path, change, words):
    with pytest.raises(ConfigError) as caught:
        reader.load(written(tmp_path, BELT.format(node="").replace(*change)))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('encoder = "count"', 'encoder = "counts"'), "names no [io] of the cell"),
        (('object = "6401h:01"', 'object = "6000h:01"\nbit = 1'), "is one bit"),
        (('object = "6401h:01"', 'object = "6411h:01"\nsafe = 0'), "is an output"),
    ],
)
def test_check_names_an_input_that_does_not_count(tmp_path, change, words):
    problems = check(written(tmp_path, BELT.format(node="").replace(*change)))
    assert any(words in problem.message for problem in problems), problems


def test_check_requires_no_defaults_of_an_encoder_axis(tmp_path):
    problems = check(written(tmp_path, BELT.format(node="")))
    assert not [problem for problem in problems if "axis belt has no default" in problem.message]
    bare = written(tmp_path, BELT.format(node="").replace('encoder = "count"', "virtual = true"))
    assert [problem for problem in check(bare) if "axis belt has no default" in problem.message]
