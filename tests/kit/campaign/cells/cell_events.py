"""Events of a drawn cell: a command is given, axes are brought back into service, a motor is pushed."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial

from axisbus.configuration.replacement_plan import NodeToReplace, plan
from axisbus.errors import AxisbusError
from axisbus.machine.handle import Handle
from axisbus.motion.states import AxisState
from kit.campaign.all_rules import Judge
from kit.campaign.cells.cell_setup import PAIR, DrawnCell
from kit.campaign.cells.commands import GANTRY, GROUP, ORDERS, Args, GroupArgs
from kit.campaign.events import Event
from kit.campaign.facts import Facts, GivenCommand
from kit.campaign.faults import ENDS, MISHAPS
from kit.campaign.violation import Violation
from kit.plant_probe import ENABLED, OFF

QUIET = 3.0  # s without trouble after which an axis counts as healthy
_FOR_SERVICE = 4.0  # s that a step of bringing into service may take
_FOR_BOOT_UP = 120.0  # s that the boot-up of a node may take, over a link that loses or delays frames
_RESTS = (AxisState.STANDSTILL,)
_PLACES = frozenset(
    {"move_absolute", "move_led", "move_waiting"}
)  # absolute moves reach their target from any motion
_NUDGES = (1, 2, 3, 5, 20)  # increments
_FARTHEST_COUNT = 2**31 - 1  # increments, of INTEGER32
_SWAPPED = 2  # one of so many boot-ups is that of a new drive
_NEW_SERIAL = 4711
_MODULE_IS_WELL = 7  # every number that it divides is a fault of the module beside the axes


def happen(event: Event, judge: Judge) -> None:
    """Let one event happen."""
    facts = judge.facts
    if event.axis and event.axis not in facts.names:
        return
    if event.what == "service":
        serve(judge)
    elif event.what == "nudge":
        _nudge(judge, event)
    elif event.what in MISHAPS or event.what in ENDS:
        facts.tally[f"mishap: {event.what}"] += event.what in MISHAPS
        judge.happen(event.what, event.axis, event.value)
    else:
        number = round(abs(event.value) * 100)
        judge.switch(event.value if number % _MODULE_IS_WELL else event.value + 0.01)
        _command(judge, event)


# -- commands ------------------------------------------------------------------------------------------------------------


def _command(judge: Judge, event: Event) -> None:
    facts = judge.facts
    cell = facts.cell
    assert isinstance(cell, DrawnCell)
    if event.what in GROUP:
        if cell.recipe.gantry or len(cell.recipe.axes) < 2:
            return
        shared = GroupArgs(cell, event.value)
        order = GROUP[event.what]
        names = cell.recipe.names if event.what == "cell_override" else shared.names
        asked = _asked(facts, event.what.removeprefix("group_"), names, order.kind)
        handle = _called(judge, asked, lambda: order.give(shared))
        goals, outside = shared.goals, shared.outside
    else:
        args = Args(cell, event.axis, event.value)
        single = GANTRY.get(event.what) or ORDERS[event.what]
        names = "ab" if event.what in GANTRY else event.axis
        if names != "ab" and cell.recipe.gantry and event.axis in "ab":
            return
        asked = _asked(facts, event.what.removeprefix("pair_"), names, single.kind)
        handle = _called(judge, asked, lambda: single.give(args))
        goals = {event.axis: args.goal} if args.goal is not None else {}
        outside = args.outside
        asked.direction = 0.0 if args.extreme else args.direction
    if handle is None:
        return
    asked.handle = handle
    if asked.kind in ("move", "path") and (asked.legal or asked.what in _PLACES):
        asked.goals = {
            name: facts.origin(name) + goal * cell.factor(name)
            for name, goal in goals.items()
            if not _may_recount(facts, name)
        }
    past_count = any(
        abs(facts.place(name)) >= 2**31 for name in asked.names
    )  # its positions are others than those before
    asked.legal = asked.legal and not outside and not past_count
    judge.asked(asked)


def _asked(facts: Facts, what: str, names: str, kind: str) -> GivenCommand:
    """A command that is about to be given: whether it must end well is decided by how its axes are now."""
    asked = GivenCommand(what, names, None, facts.now, kind=kind)  # type: ignore[arg-type]
    asked.starts = {name: facts.where(name) for name in names}
    asked.legal = all(_is_ready(facts, name, kind) for name in names) and is_healthy(facts)
    if what == "home":
        asked.legal = asked.legal and not any(facts.cell.recipe.axis(name).modes for name in names)
    return asked


def is_healthy(facts: Facts, within: float = QUIET) -> bool:
    """Whether nothing has gone wrong with any axis for so long."""
    return not any(True for name in facts.names for _ in facts.troubled(name, within))


def _is_ready(facts: Facts, name: str, kind: str) -> bool:
    """Whether an axis is in service, at standstill, and has no command; a stop must end well whatever it does."""
    core = facts.core[name]
    if core.error is not None or facts.stage(name) != ENABLED:
        return False
    if kind == "stop":
        return True
    busy = any(
        asked.ended is None and name in asked.names and asked.kind not in ("override", "probe")
        for asked in facts.asked
    )
    homed = core.homed or not core.parameters.homing.required
    return (
        core.state in _RESTS and not busy and homed and not facts.moves(name) and core.override.factor > 0.0
    )


def _may_recount(facts: Facts, name: str) -> bool:
    """Whether a command that has not ended may still give the axis another origin."""
    return any(
        asked.ended is None and name in asked.names and asked.kind in ("set", "home") for asked in facts.asked
    )


def _called(judge: Judge, asked: GivenCommand, give: Callable[[], Handle]) -> Handle | None:
    """Give the command; None if it is refused at the call.

    Raises:
        Violation: another exception is raised.
    """
    facts = judge.facts
    counts = asked.kind != "extreme"  # those are to be refused
    facts.tally["commands"] += counts
    try:
        return give()
    except AxisbusError as error:
        facts.tally[f"refused: {asked.what}"] += 1
        facts.tally["commands refused at the call"] += counts
        judge.refused(asked, error)
        return None
    except Violation:
        raise
    except Exception as error:
        raise Violation(
            "a call raises only the library's own errors", f"{asked.what}: {type(error).__name__}: {error}"
        ) from error


# -- service -------------------------------------------------------------------------------------------------------------


def serve(judge: Judge) -> None:
    """End all faults, and bring all axes back into service."""
    facts = judge.facts
    for name in facts.names:
        for trouble in list(facts.troubled(name, 0.0)):
            if trouble.kind.ends and trouble.axis == name:
                judge.happen(trouble.kind.ends, name, 0.0)
    judge.run(0.5)
    _boot_nodes(judge)
    pair = facts.cell.recipe.gantry  # type: ignore[attr-defined]
    for step in ("release", "reset", "enable"):
        given = [_step(judge, step, name) for name in facts.names if not (pair and name in "ab")]
        if pair:
            given.append(_step(judge, step, "ab"))
        _wait(judge, [asked for asked in given if asked is not None])
    judge.run(0.2)


def _boot_nodes(judge: Judge) -> None:
    """Boot the nodes that have restarted, while the axes of the others continue; each boot-up may fail.

    Some have a new drive meanwhile, which is found and booted as ``axisbus replace`` does.
    """
    facts, machine = judge.facts, judge.facts.cell.machine
    runtime, clock = machine._core.runtime, machine._core.clock
    for name in facts.names:
        node_id = machine.cell.axes[name].node
        if not runtime.nodes[node_id].has_objects or not runtime.has_returned(node_id):
            continue
        facts.tally["node booted again"] += 1
        boot = _boot
        if (node_id + facts.tally["node booted again"]) % _SWAPPED == 0:
            _swap(judge, name, node_id)
            boot = _replace
        thread = clock.thread(partial(boot, facts, node_id), f"boot of node {node_id}")
        thread.start()
        end = facts.now + _FOR_BOOT_UP
        while thread.is_alive():
            facts.must(facts.now < end, "every boot-up ends", f"that of node {node_id} has not")
            judge.run(0.05)


def _swap(judge: Judge, name: str, node_id: int) -> None:
    """Put another drive in the place of that of an axis, while its supply is off."""
    judge.happen("loses_supply", name, 0.0)
    judge.run(0.5)
    judge.facts.cell.machine.simulated_node(node_id).swap(_NEW_SERIAL)
    judge.happen("supply_returns", name, 0.0)
    judge.run(0.5)


def _boot(facts: Facts, node_id: int) -> None:
    with suppress(AxisbusError):
        facts.cell.machine.node(node_id).boot()


def _replace(facts: Facts, node_id: int) -> None:
    node = facts.cell.machine.node(node_id)
    with suppress(AxisbusError):
        new = NodeToReplace(node_id, "cell.toml", running=True)
        node.replace_drive(plan(new, node.find_replacement()).order)
        facts.tally["drive replaced"] += 1


def _step(judge: Judge, step: str, names: str) -> GivenCommand | None:
    """Give an axis the next command that it needs to be in service, if any."""
    facts, core = judge.facts, judge.facts.core[names[0]]
    needed = {
        "release": core.state is AxisState.STOPPING,
        "reset": any(facts.core[name].error is not None for name in names),
        "enable": any(facts.stage(name) in OFF for name in names),
    }
    if not needed[step]:
        return None
    whose = facts.cell.machine.gantry(PAIR) if names == "ab" else facts.cell[names]
    asked = GivenCommand(step, names, None, facts.now, kind="power")  # type: ignore[arg-type]
    try:
        asked.handle = getattr(whose, step)()
    except AxisbusError:
        return None
    judge.asked(asked)
    return asked


def _wait(judge: Judge, given: list[GivenCommand]) -> None:
    end = judge.facts.now + _FOR_SERVICE
    while any(asked.ended is None for asked in given) and judge.facts.now < end:
        judge.run(0.05)


def _nudge(judge: Judge, event: Event) -> None:
    """Move an unpowered axis by a few increments, possibly just outside a limit."""
    facts = judge.facts
    cell = facts.cell
    assert isinstance(cell, DrawnCell)
    for name in event.axis or facts.names:
        if cell.recipe.gantry and name in "ab":
            continue
        args = Args(cell, name, event.value)
        edges = args.recipe.edges
        if edges is None or facts.core[name].error is not None or facts.moves(name) or not is_healthy(facts):
            continue
        edge = args.chance.choice(edges)
        out = args.chance.choice(_NUDGES) * (1.0 if edge == edges[1] else -1.0)
        away = edge - args.here + out / args.recipe.scale  # in units
        push = round(away * cell.factor(name) * _sign(cell, name))
        if abs(facts.place(name) + push) > _FARTHEST_COUNT:  # the drive's count would begin again
            continue
        asked = GivenCommand("disable", name, cell[name].disable(), facts.now, kind="stop")
        judge.asked(asked)
        _wait(judge, [asked])
        if facts.stage(name) not in OFF or facts.core[name].error is not None:
            continue
        judge.pushed(name, push)
        judge.run(0.3)
        step = _step(judge, "enable", name)
        _wait(judge, [step] if step is not None else [])


def _sign(cell: DrawnCell, name: str) -> int:
    """-1 where the drive turns the direction (607Eh), by its own object."""
    return -1 if cell.drive(name).settings.polarity & 0x80 else 1
