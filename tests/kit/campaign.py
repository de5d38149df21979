"""Random commands against random mishaps, as scripts of plain events that replay exactly and shrink to what is needed.

Theory of operation
-------------------
``script`` makes a list of events from a seed. ``play`` runs it on a fresh cell and returns the first ``Violation``, None when all
rules of ``kit.campaign_rules`` held. ``shrink`` leaves events out as long as the same rule is violated. Nothing here reads a clock:
the same script gives the same plant.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from axisbus.cia301.nmt import NmtCommand
from axisbus.errors import AxisbusError
from axisbus.motion.handle import Handle
from axisbus.motion.trajectory import Trapezoid
from kit.campaign_rules import Rules, Violation
from kit.cell import Cell, Stage
from kit.plants import PLANTS, Ramp, cell_on

AXES = "xy"
NODES = {name: node for node, name in enumerate(AXES, start=1)}
PLANTS_USED = ("stiff", "stiff", "lagging", "lagging-much", "coasting", "compliant", "late-feedback")


class Event(NamedTuple):
    """What happens to an axis (or to the group ``""``) after ``pause`` seconds."""

    pause: float
    what: str
    axis: str
    value: float = 0.0


class Script(NamedTuple):
    """A plant, by its name in ``kit.plants``, and what happens to it."""

    plant: str
    events: tuple[Event, ...]


# -- commands: (cell, name of the axis, a number from -1 to 1) ---------------------------------------------------------------

Command = Callable[[Cell, str, float], Handle]


def _demand(cell: Cell, name: str) -> float:
    """Where a trajectory has to begin."""
    snapshot = cell.core(name).snapshot()
    units = cell.core(name).parameters.units.position
    reference = cell.core(name).image.reference
    return units.to_units((reference or 0) - snapshot.origin)


def _trapezoid(cell: Cell, name: str, value: float) -> Handle:
    start = _demand(cell, name)
    return cell[name].follow(Trapezoid(start, start + 200.0 * value, 100.0, 500.0))


COMMANDS: Mapping[str, Command] = {
    "enable": lambda cell, name, _: cell[name].enable(),
    "disable": lambda cell, name, _: cell[name].disable(),
    "coast": lambda cell, name, _: cell[name].disable(coast=True),
    "reset": lambda cell, name, _: cell[name].reset(),
    "halt": lambda cell, name, _: cell[name].halt(),
    "stop": lambda cell, name, _: cell[name].stop(),
    "release": lambda cell, name, _: cell[name].release(),
    "quick_stop": lambda cell, name, _: cell[name].quick_stop(),
    "move_relative": lambda cell, name, value: cell[name].move_relative(300.0 * value, velocity=100.0),
    "move_additive": lambda cell, name, value: cell[name].move_additive(100.0 * value, velocity=60.0),
    "move_absolute": lambda cell, name, value: cell[name].move_absolute(200.0 * value, velocity=150.0),
    "move_velocity": lambda cell, name, value: cell[name].move_velocity(100.0 * value),
    "jog": lambda cell, name, value: cell[name].jog(80.0 * value),
    "torque": lambda cell, name, value: cell[name].torque_control(0.3 * value),
    "home": lambda cell, name, _: cell[name].home(),
    "set_position": lambda cell, name, value: cell[name].set_position(100.0 * value),
    "follow": _trapezoid,
    "follow_on": lambda cell, name, _: cell[name].follow(Ramp(_demand(cell, name))),
}
GROUP: Mapping[str, Callable[[Cell, float], Handle]] = {
    "group_enable": lambda cell, _: _group(cell).enable(),
    "group_disable": lambda cell, _: _group(cell).disable(),
    "group_halt": lambda cell, _: _group(cell).halt(),
    "group_stop": lambda cell, _: _group(cell).stop(),
    "group_release": lambda cell, _: _group(cell).release(),
    "group_reset": lambda cell, _: _group(cell).reset(),
    "group_quick_stop": lambda cell, _: _group(cell).quick_stop(),
    "move_linear": lambda cell, value: _group(cell).move_linear((200.0 * value, 150.0), velocity=100.0),
    "move_direct": lambda cell, value: _group(cell).move_direct((150.0, 200.0 * value), velocity=100.0),
}


def _group(cell: Cell):
    return cell.machine.group(*AXES)


# -- mishaps: (cell, name of the axis, the number) ---------------------------------------------------------------------------

Mishap = Callable[[Cell, str, float], object]


def _sdo_well(cell: Cell, name: str) -> None:
    dials = cell.device(name).dials
    dials.sdo_silent, dials.sdo_delay = False, 0.0


def _dial(name: str, value: object) -> Mishap:
    return lambda cell, axis, _: setattr(cell.drive(axis).dials, name, value)


def _node_dial(name: str, value: object) -> Mishap:
    return lambda cell, axis, _: setattr(cell.device(axis).dials, name, value)


MISHAPS: Mapping[str, Mishap] = {
    "jam": lambda cell, name, _: cell.jam(name),
    "free": lambda cell, name, _: cell.free(name),
    "sticks": _dial("sticks", 400.0),
    "sticks_no_more": _dial("sticks", 0.0),
    "fault": lambda cell, name, _: cell.drive(name).fault(0x2310),
    "drops_power": lambda cell, name, _: cell.drive(name).power.force(9),
    "dead": _node_dial("dead", True),
    "alive": _node_dial("dead", False),
    "pre_operational": lambda cell, name, _: cell.cycle.nmt(NmtCommand.ENTER_PRE_OPERATIONAL, NODES[name]),
    "start": lambda cell, name, _: cell.cycle.nmt(NmtCommand.START, NODES[name]),
    "no_heartbeat": _node_dial("heartbeat_stops", True),
    "heartbeat": _node_dial("heartbeat_stops", False),
    "sdo_late": _node_dial("sdo_delay", 0.3),
    "sdo_silent": _node_dial("sdo_silent", True),
    "sdo_well": lambda cell, name, _: _sdo_well(cell, name),
    "slips_to_pp": _dial("mode_slips_to", 1),
    "slips_to_pv": _dial("mode_slips_to", 3),
    "slips_to_csp": _dial("mode_slips_to", 8),
    "slips_no_more": _dial("mode_slips_to", None),
    "resumes": _dial("resumes_on_enable", True),
    "ignores_halt": _dial("ignore_halt", True),
    "hears_halt": _dial("ignore_halt", False),
    "ignores_quick_stop": _dial("ignore_quick_stop", True),
    "hears_quick_stop": _dial("ignore_quick_stop", False),
    "ignores_off": _dial("ignore_disable_voltage", True),
    "hears_off": _dial("ignore_disable_voltage", False),
    "creeps": _dial("creep", 1500.0),
    "creeps_no_more": _dial("creep", 0.0),
    "demand_stuck": _dial("demand_frozen", True),
    "demand_live": _dial("demand_frozen", False),
    "always_there": _dial("target_reached_always", True),
    "never_there": _dial("target_reached_never", True),
    "keeps_acknowledge": _dial("acknowledge_stays", True),
    "lets_acknowledge_go": _dial("acknowledge_stays", False),
    "slow_to_enable": _dial("transition_delay", {4: 0.5}),
    "encoder_jumps": lambda cell, name, value: setattr(
        cell.drive(name).dials, "encoder_jump", round(300 * value)
    ),
}
_MOTIONS = (
    "move_relative",
    "move_absolute",
    "move_velocity",
    "move_additive",
    "follow",
    "follow_on",
    "jog",
    "torque",
    "home",
)
_STOPS = ("halt", "halt", "stop", "stop", "quick_stop", "disable", "coast")
_GROUP_MOTIONS = ("move_linear", "move_direct")
_GROUP_STOPS = ("group_halt", "group_stop", "group_quick_stop", "group_disable")
_PAUSES = (0.0, 0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.5)
# What brings an axis back into service, whatever was the matter with it: pauses and events.
_RECOVERY = (
    (0.0, "free"),
    (0.0, "slips_no_more"),
    (0.0, "creeps_no_more"),
    (0.0, "hears_halt"),
    (0.0, "hears_quick_stop"),
    (0.0, "hears_off"),
    (0.0, "sdo_well"),
    (0.0, "alive"),
    (0.0, "heartbeat"),
    (0.0, "start"),
    (1.0, "release"),
    (0.1, "reset"),
    (0.5, "enable"),
    (0.5, "halt"),
)


def script(seed: int, episodes: int = 4) -> Script:
    """Return what happens in the campaign of a seed; every axis is enabled at its beginning."""
    chance = random.Random(seed)
    plant = chance.choice(PLANTS_USED)
    events = [event for _ in range(episodes) for event in _episode(chance)]
    return Script(plant, tuple(events))


def _episode(chance: random.Random) -> list[Event]:
    """Bring the axes into service, let them move, let something go wrong, stop, and let something more happen."""
    axis = chance.choice("xxxy")
    events = [
        *_recovery(chance, axis),
        *_some(chance, axis, _MOTIONS, _GROUP_MOTIONS, 1, 2),
        *_some(chance, axis, (*MISHAPS, *["jam"] * 20), (), 0, 2),
        *_some(chance, axis, _STOPS, _GROUP_STOPS, 0, 2),
        *_some(chance, axis, (*COMMANDS, *["free"] * 9), tuple(GROUP), 0, 3),
    ]
    if len(events) > 1 and chance.random() < 0.3:  # sometimes in another order
        one = chance.randrange(len(events) - 1)
        events[one], events[one + 1] = events[one + 1], events[one]
    return events


def _recovery(chance: random.Random, axis: str) -> list[Event]:
    names = chance.choice((axis, AXES, AXES, ""))
    return [
        Event(pause if name == names[0] else 0.0, what, name) for pause, what in _RECOVERY for name in names
    ]


def _some(
    chance: random.Random, axis: str, own: Sequence[str], shared: Sequence[str], least: int, most: int
) -> list[Event]:
    """Return some events of an axis, or of its group, with pauses and numbers by chance."""
    events = []
    for _ in range(chance.randint(least, most)):
        grouped = bool(shared) and chance.random() < 0.2
        what = chance.choice(shared if grouped else own)
        value = round(chance.uniform(-1.0, 1.0), 2)
        events.append(Event(chance.choice(_PAUSES), what, "" if what in GROUP else axis, value))
    return events


def play(made: Script, folder: Path) -> Violation | None:
    """Run a script on a fresh cell; return the first rule that did not hold, None when all did."""
    with Stage(folder) as stage:
        cell = cell_on(stage, PLANTS[made.plant], AXES)
        rules = Rules(cell, AXES)
        try:
            for number, event in enumerate(made.events):
                rules.now_at(number, str(event))
                rules.run(event.pause)
                happen(cell, event, rules)
            rules.now_at(len(made.events), "the end")
            rules.run(1.0)
            rules.leave()
        except Violation as violation:
            return violation
        finally:
            rules.forget()
    return None


def happen(cell: Cell, event: Event, rules: Rules) -> None:
    """Let one event happen; a command that is refused at the call has not been given."""
    if event.what in MISHAPS:
        rules.mishap(event.what, event.axis)
        MISHAPS[event.what](cell, event.axis, event.value)
        return
    names = event.axis or AXES
    with suppress(AxisbusError):
        if event.what in GROUP:
            handle = GROUP[event.what](cell, event.value)
        else:
            handle = COMMANDS[event.what](cell, event.axis, event.value)
        rules.asked(event.what.removeprefix("group_"), names, handle)


def shrink(made: Script, violation: Violation, folder: Path, replays: int = 300) -> tuple[Script, Violation]:
    """Leave out events as long as the same rule is violated."""
    size = max(1, len(made.events) // 2)
    while size and replays > 0:
        start, smaller = 0, False
        while start < len(made.events) and replays > 0:
            fewer = Script(made.plant, made.events[:start] + made.events[start + size :])
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
    return "\n".join([*lines, "))"])


def campaign(seeds: Sequence[int], folder: Path) -> list[str]:
    """Play the scripts of these seeds; return what has failed, each shrunk."""
    failed = []
    for seed in seeds:
        made = script(seed)
        violation = play(made, folder)
        if violation is not None:
            failed.append(f"seed {seed}: " + told(*shrink(made, violation, folder)))
    return failed
