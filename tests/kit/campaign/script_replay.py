"""Play a script on a fresh cell, and shrink one that fails to its necessary events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from axisbus.errors import AxisbusError
from axisbus.machine.handle import Handle
from kit.campaign.all_rules import Judge
from kit.campaign.cells import cell_events as drawn
from kit.campaign.cells.recipe import CellRecipe, simpler
from kit.campaign.cells.recipe import told as told_cell
from kit.campaign.cells.scene import scene_on
from kit.campaign.commands import GROUP, ORDERS, OVERRIDES, PLACES, demand_of
from kit.campaign.events import Event, Script
from kit.campaign.facts import Facts, GivenCommand
from kit.campaign.faults import ENDS, MISHAPS, Site
from kit.campaign.gantry.commands import PAIR, kind_and_axes
from kit.campaign.pdo_faults import Wire
from kit.campaign.scenes import NotHere, plant_of, scene_of
from kit.campaign.violation import Violation
from kit.cell import Cell, Stage


class Played(NamedTuple):
    """The result of a script: the violation (None: none), its commands, virtual seconds, and the slowest stop in s.

    ``tally``: the exercised rules, and how often.
    """

    violation: Violation | None
    commands: int
    seconds: float
    worst: float
    tally: Counter[str]


def play(made: Script, folder: Path) -> Violation | None:
    """Run a script on a fresh cell; return the first rule that did not hold, None when all did.

    Raises:
        NotHere: its scene cannot be played here.
    """
    return run(made, folder).violation


def run(made: Script, folder: Path) -> Played:
    """As ``play``, with the figures."""
    scene = scene_of(made.scene) if made.cell is None else scene_on(made.cell)
    with Stage(folder) as stage:
        try:
            cell = scene.open(stage, plant_of(made.plant))
        except Violation as violation:
            return Played(violation, 0, 0.0, 0.0, Counter())
        wires = {name: Wire(cell, name, scene.period) for name in scene.names}
        judge = Judge(Facts(Site(cell, wires), scene))
        try:
            _run(made, judge)
        except Violation as violation:
            return _played(violation, judge)
        finally:
            judge.forget()
        return _played(None, judge)


def _played(violation: Violation | None, judge: Judge) -> Played:
    facts = judge.facts
    return Played(violation, len(facts.asked), facts.now, facts.worst, facts.tally)


def _run(made: Script, judge: Judge) -> None:
    happens = happen if made.cell is None else drawn.happen
    for number, event in enumerate(made.events):
        judge.facts.at = f"[{number}] {event}"
        judge.run(event.pause)
        happens(event, judge)
    judge.facts.at = "the end"
    judge.run(1.0)
    _lift(judge.facts, judge)
    judge.settle()
    judge.leave(made.ending)


def _lift(facts: Facts, judge: Judge) -> None:
    """Let motions held by an override continue to their end."""
    overridden = any(
        facts.cell.core(name).override.factor != 1.0 for name in facts.names
    )  # also by an extreme value
    if not overridden and not any(asked.what in OVERRIDES for asked in facts.asked):
        return
    machine = facts.cell.machine
    pairs = [machine.gantry(name) for name in machine.cell.gantries]
    groups = [*machine.groups.values()] or [machine.group(*facts.names)]
    for whose in (*groups, machine, *machine, *pairs):
        with suppress(AxisbusError):
            judge.asked(GivenCommand("cell_override", facts.names, whose.set_override(1.0), facts.now, {}))


def happen(event: Event, judge: Judge) -> None:
    """Let one event happen; a command that is refused at the call has not been given."""
    facts = judge.facts
    if event.axis and event.axis not in facts.names:
        return
    if event.what in MISHAPS or event.what in ENDS:
        judge.happen(event.what, event.axis, event.value)
        return
    judge.switch(event.value)
    with suppress(AxisbusError):
        goals = dict(_goals(facts, event))
        handle = _give(facts.cell, event)
        judge.asked(GivenCommand(*_kind_and_axes(event, facts), handle, facts.now, goals))


def _kind_and_axes(event: Event, facts: Facts) -> tuple[str, str]:
    """Its kind for the rules, and its axes."""
    if event.what in PAIR:
        return kind_and_axes(event.what, facts.names)
    return event.what.removeprefix("group_"), event.axis or facts.names


def _give(cell: Cell, event: Event) -> Handle:
    if event.what in PAIR:
        return PAIR[event.what](cell, event.value)
    if event.what in GROUP:
        return GROUP[event.what](cell, event.value)
    return ORDERS[event.what].give(cell, event.axis, event.value)


def _goals(facts: Facts, event: Event) -> Iterable[tuple[str, float]]:
    """The target of a command for an axis, in the drive's increments, if it is known before: from standstill, or absolute."""
    order = ORDERS.get(event.what)
    if order is None or order.goal is None:
        return
    name, way = event.axis, order.goal * event.value
    own = [asked for asked in facts.asked if name in asked.names]
    passes = event.what == "move_blended" and not any(asked.what == "superimposed" for asked in own)
    if any(asked.ended is None and not (passes and asked.what in PLACES) for asked in own):
        return  # the running motion may move the origin, or the begin
    if order.relative and facts.moves(name):
        return  # it begins where the master saw it last
    units = facts.cell.core(name).parameters.units.position
    start = demand_of(facts.cell, name) if order.relative else 0.0
    if facts.cell.core(name).parameters.units.modulo is None:
        yield name, facts.origin(name) + (start + way) * units.factor


def shrink(made: Script, violation: Violation, folder: Path, replays: int = 300) -> tuple[Script, Violation]:
    """Remove events and unusual values of a drawn cell as long as the same rule is violated."""
    made, violation = _fewer_events(made, violation, folder, replays)
    if made.cell is not None:
        made, violation = _simpler_cell(made, violation, folder, replays)
    return made, violation


def _simpler_cell(made: Script, violation: Violation, folder: Path, replays: int) -> tuple[Script, Violation]:
    """Make the cell more usual, thing by thing, as long as the same rule is violated."""
    tried: set[CellRecipe] = set()
    left = replays
    while made.cell is not None and left > 0:
        for cell in simpler(made.cell):
            if cell in tried or left <= 0:
                continue
            tried.add(cell)
            left -= 1
            found = _same(made._replace(cell=cell), violation, folder)
            if found is not None:
                made, violation = made._replace(cell=cell), found
                break
        else:
            break
    return made, violation


def _same(made: Script, violation: Violation, folder: Path) -> Violation | None:
    """Return how a script violates the same rule, None where it does not."""
    try:
        found = play(made, folder)
    except (NotHere, AxisbusError):
        return None
    return found if found is not None and found.kind == violation.kind else None


def _fewer_events(made: Script, violation: Violation, folder: Path, replays: int) -> tuple[Script, Violation]:
    size = max(1, len(made.events) // 2)
    while size and replays > 0:
        start, smaller = 0, False
        while start < len(made.events) and replays > 0:
            fewer = made._replace(events=made.events[:start] + made.events[start + size :])
            replays -= 1
            found = _same(fewer, violation, folder)
            if found is not None:
                made, violation, smaller = fewer, found, True
            else:
                start += size
        if not smaller or size == 1:
            size = 0 if size == 1 and not smaller else max(1, size // 2)
    return made, violation


def told(made: Script, violation: Violation) -> str:
    """Return a script that fails as a person reads it, and can paste it."""
    lines = [f"{violation.kind}: {violation}", f"Script({made.plant!r}, ("]
    lines += [f"    {event!r}," for event in made.events]
    cell = "" if made.cell is None else f", cell={told_cell(made.cell)}"
    return "\n".join([*lines, f"), scene={made.scene!r}, ending={made.ending!r}{cell})"])
