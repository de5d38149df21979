"""Play a script on a fresh cell, and shrink one that fails to what it needs."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from axisbus.errors import AxisbusError
from axisbus.machine.handle import Handle
from kit.campaign.events import Event, Script
from kit.campaign.facts import Asked, Facts, Violation
from kit.campaign.gantry.orders import PAIR, asked_of
from kit.campaign.gantry.scene import NAME
from kit.campaign.judge import Judge
from kit.campaign.mishaps import ENDS, MISHAPS, Site
from kit.campaign.orders import GROUP, ORDERS, OVERRIDES, PLACES, demand_of
from kit.campaign.scenes import plant_of, scene_of
from kit.campaign.wire import Wire
from kit.cell import Cell, Stage


class Played(NamedTuple):
    """What came of a script: what did not hold (None: all did), its commands, virtual seconds, and the slowest stop in s."""

    violation: Violation | None
    commands: int
    seconds: float
    worst: float


def play(made: Script, folder: Path) -> Violation | None:
    """Run a script on a fresh cell; return the first rule that did not hold, None when all did.

    Raises:
        NotHere: its scene cannot be played here.
    """
    return run(made, folder).violation


def run(made: Script, folder: Path) -> Played:
    """As ``play``, with the figures."""
    scene = scene_of(made.scene)
    with Stage(folder) as stage:
        cell = scene.open(stage, plant_of(made.plant))
        wires = {name: Wire(cell.port(name), number, scene.period) for number, name in enumerate(scene.names)}
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
    return Played(violation, len(facts.asked), facts.now, facts.worst)


def _run(made: Script, judge: Judge) -> None:
    for number, event in enumerate(made.events):
        judge.facts.at = f"[{number}] {event}"
        judge.run(event.pause)
        happen(event, judge)
    judge.facts.at = "the end"
    judge.run(1.0)
    _lift(judge.facts, judge)
    judge.settle()
    judge.leave(made.ending)


def _lift(facts: Facts, judge: Judge) -> None:
    """Let what an override holds go on to its end."""
    if not any(asked.what in OVERRIDES for asked in facts.asked):
        return
    machine = facts.cell.machine
    pair = (machine.gantry(NAME),) if facts.scene.pair else ()
    for whose in (machine.group(*facts.names), machine, *machine, *pair):
        with suppress(AxisbusError):
            judge.asked(Asked("cell_override", facts.names, whose.set_override(1.0), facts.now, {}))


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
        judge.asked(Asked(*_asked_of(event, facts), handle, facts.now, goals))


def _asked_of(event: Event, facts: Facts) -> tuple[str, str]:
    """What it is for the rules, and the axes that it is for."""
    if event.what in PAIR:
        return asked_of(event.what, facts.names)
    return event.what.removeprefix("group_"), event.axis or facts.names


def _give(cell: Cell, event: Event) -> Handle:
    if event.what in PAIR:
        return PAIR[event.what](cell, event.value)
    if event.what in GROUP:
        return GROUP[event.what](cell, event.value)
    return ORDERS[event.what].give(cell, event.axis, event.value)


def _goals(facts: Facts, event: Event) -> Iterable[tuple[str, float]]:
    """Where a command leads an axis, in the drive's increments, where that is known before: from rest, or to a place."""
    order = ORDERS.get(event.what)
    if order is None or order.goal is None:
        return
    name, way = event.axis, order.goal * event.value
    own = [asked for asked in facts.asked if name in asked.names]
    passes = event.what == "move_blended" and not any(asked.what == "superimposed" for asked in own)
    if any(asked.ended is None and not (passes and asked.what in PLACES) for asked in own):
        return  # what is under way may move the origin, or where it begins
    if order.relative and facts.moves(name):
        return  # it begins where the master saw it last
    units = facts.cell.core(name).parameters.units.position
    start = demand_of(facts.cell, name) if order.relative else 0.0
    if facts.cell.core(name).parameters.units.modulo is None:
        yield name, facts.origin(name) + (start + way) * units.factor


def shrink(made: Script, violation: Violation, folder: Path, replays: int = 300) -> tuple[Script, Violation]:
    """Leave out events as long as the same rule is violated."""
    size = max(1, len(made.events) // 2)
    while size and replays > 0:
        start, smaller = 0, False
        while start < len(made.events) and replays > 0:
            fewer = made._replace(events=made.events[:start] + made.events[start + size :])
            replays -= 1
            found = play(fewer, folder)
            if found is not None and found.rule == violation.rule:
                made, violation, smaller = fewer, found, True
            else:
                start += size
        if not smaller or size == 1:
            size = 0 if size == 1 and not smaller else max(1, size // 2)
    return made, violation


def told(made: Script, violation: Violation) -> str:
    """Return a script that fails as a person reads it, and can paste it."""
    lines = [f"{violation.rule}: {violation}", f"Script({made.plant!r}, ("]
    lines += [f"    {event!r}," for event in made.events]
    return "\n".join([*lines, f"), scene={made.scene!r}, ending={made.ending!r})"])
