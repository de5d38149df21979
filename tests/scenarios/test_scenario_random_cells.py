"""Random commands and faults on drawn cells: other axes, units, scales, limits, drives and neighbours in each scenario.

``make campaign`` plays fresh ones by the thousand; a seed that fails is shrunk, with its cell, and printed as a script.
"""

from __future__ import annotations

import random

import pytest

from kit.campaign.cells.commands import ALONG, GANTRY, GROUP, MOTIONS, ORDERS, STOPS
from kit.campaign.cells.recipe import AxisRecipe, CellRecipe, draw, simpler, told
from kit.campaign.cells.scripts import is_known, script
from kit.campaign.events import Event, Script
from kit.campaign.mutants import MUTANTS, mutated
from kit.campaign.scenes import NotHere
from kit.campaign.script_replay import play, run, shrink
from kit.campaign.script_replay import told as told_script
from kit.campaign.violation import Violation

# Cells of no maker's file, whose scenarios are short; the campaign plays the others.
SEEDS = (
    1, 3, 8, 12, 14, 16, 17, 18, 24, 27, 31, 32, 33, 45, 47, 49, 50, 51, 53, 55, 58, 59, 60, 64, 66, 68, 70, 72, 73, 75,
    76, 81, 82)  # fmt: skip
# Scripts in which a mutant violates a rule of the campaign that holds without the mutant.
NOTICED = {
    "no-look-ahead": Script(
        "stiff",
        (Event(0.2, "move_velocity", "a", 0.9), Event(3.0, "halt", "a")),
        "drawn",
        cell=CellRecipe((AxisRecipe(limits=(-0.5, 0.5)),)),
    ),
    "shifted-targets": Script(
        "stiff",
        (Event(0.2, "move_waiting", "a", 0.5),),
        "drawn",
        cell=CellRecipe((AxisRecipe(limits=(-0.5, 0.5)),)),
    ),
    "wrong-way": Script(
        "stiff", (Event(0.2, "move_velocity", "a", 0.5),), "drawn", cell=CellRecipe((AxisRecipe(),))
    ),
    "no-fault-policy": Script(
        "stiff",
        (Event(0.2, "move_velocity", "a", 0.5), Event(1.0, "fault", "b"), Event(8.0, "probe", "a")),
        "drawn",
        cell=CellRecipe((AxisRecipe(), AxisRecipe(unit="mm", scale=1000.0)), group=2),
    ),
    "endless-count": Script(
        "stiff",
        (Event(0.2, "move_relative", "a", 0.2), Event(1.0, "probe", "a")),
        "drawn",
        cell=CellRecipe((AxisRecipe(start=2**31 - 8000, homed=False),)),
    ),
    "no-window": Script(
        "stiff",
        (Event(0.2, "nudge", "a", 0.5), Event(0.2, "move_velocity", "a", -0.3), Event(0.3, "halt", "a")),
        "drawn",
        cell=CellRecipe((AxisRecipe(limits=(-0.5, 0.5), noise=2.0),)),
    ),
    "aimed-at-once": Script(
        "stiff",
        (
            Event(0.2, "move_velocity", "a", 0.5),
            Event(2.0, "axis_override", "a", -0.9),
            Event(4.0, "probe", "a"),
        ),
        "drawn",
        cell=CellRecipe((AxisRecipe(),)),
    ),
    "silent-after-boot-up": Script(
        "stiff",
        (Event(0.2, "move_velocity", "a", 0.5), Event(1.0, "second_device", "a"), Event(20.0, "probe", "a")),
        "drawn",
        cell=CellRecipe((AxisRecipe(),)),
    ),
    "age-by-reception": Script(
        "stiff",
        (Event(0.2, "move_velocity", "a", 0.5), Event(1.0, "wire_slows", "a"), Event(3.0, "probe", "a")),
        "drawn",
        cell=CellRecipe((AxisRecipe(),)),
    ),
}


def must_hold(made: Script, folder) -> None:
    try:
        violation = play(made, folder)
    except NotHere as error:
        pytest.skip(str(error))
    if violation is not None:
        pytest.fail(told_script(*shrink(made, violation, folder, 30)))


@pytest.mark.parametrize("seed", SEEDS)
def test_on_any_cell_the_plant_keeps_the_masters_promises(tmp_path, seed):
    must_hold(script(seed), tmp_path)


def test_a_script_replays_exactly(tmp_path):
    assert script(3) == script(3)
    first, second = (run(script(12), tmp_path) for _ in range(2))
    assert first.tally == second.tally
    assert first.seconds == second.seconds


def test_every_event_of_the_scripts_is_known():
    events = {event.what for seed in range(300) for event in script(seed).events}
    assert all(map(is_known, events))
    assert {"service", "nudge", "fault"} <= events
    assert set(MOTIONS) | set(STOPS) | set(ALONG) <= set(ORDERS)
    assert events & set(GROUP)
    assert events & set(GANTRY)


def test_cells_differ_and_are_printed_as_they_can_be_pasted():
    cells = [draw(random.Random(seed)) for seed in range(300)]
    assert len(set(cells)) > 290
    assert all(eval(told(cell)) == cell for cell in cells)
    assert {len(cell.axes) for cell in cells} == {1, 2, 3, 4, 5, 6}
    assert {cell.beside for cell in cells} == {"", "io", "module", "encoder", "virtual"}
    assert {cell.kinematics for cell in cells} == {"", "corexy", "scara", "delta"}


def test_a_simpler_cell_differs_by_one_thing():
    cell = CellRecipe((AxisRecipe(noise=2.0, lag=0.05), AxisRecipe()), period=20)
    found = set(simpler(cell))
    assert cell._replace(period=10) in found
    assert cell._replace(axes=(cell.axes[0],)) in found
    assert cell._replace(axes=(AxisRecipe(noise=2.0), AxisRecipe())) in found
    assert cell not in found


@pytest.mark.parametrize("name", NOTICED)
def test_a_mutant_is_noticed(tmp_path, name):
    assert play(NOTICED[name], tmp_path) is None
    with mutated(name):
        violation = play(NOTICED[name], tmp_path)
    assert isinstance(violation, Violation), MUTANTS[name].what


def test_every_attribute_that_a_mutant_replaces_exists_and_is_restored():
    for name, mutant in MUTANTS.items():
        before = [getattr(where, attribute) for where, attribute, _ in mutant.patches]
        with mutated(name):
            assert all(
                getattr(where, attribute) is not old
                for (where, attribute, _), old in zip(mutant.patches, before, strict=True)
            )
        assert [getattr(where, attribute) for where, attribute, _ in mutant.patches] == before
