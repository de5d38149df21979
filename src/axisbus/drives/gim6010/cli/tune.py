"""``axisbus gim6010 tune``: try gains of a module by a step there and back, and measure the response."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import click

from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_next
from axisbus.cli.shared.options import Seconds
from axisbus.drives.gim6010.cli.bus import (
    ask,
    end_by,
    require_bus,
    require_node,
    run_alone,
    without_remote,
    yes_option,
)
from axisbus.drives.gim6010.cli.module_selection import (
    ModuleSelection,
    module_options,
    opened,
    require_can,
    require_list,
)
from axisbus.drives.gim6010.parameters import values
from axisbus.drives.gim6010.tuning import (
    MOST_TRIALS,
    Gains,
    GainSearch,
    Loop,
    ModuleTrial,
    ModuleTuning,
    explanation,
    following,
    worse,
)

_PATHS = {
    "position": "axis0.controller.config.pos_gain",
    "velocity": "axis0.controller.config.vel_gain",
    "integrator": "axis0.controller.config.vel_integrator_gain",
}


@click.command("tune")
@click.argument("loop", type=click.Choice(["position", "velocity"]))
@click.option(
    "--step", "size", type=float, required=True, help="Size of the step, in turns or turns/s of the rotor."
)
@click.option(
    "--for",
    "seconds",
    type=Seconds(),
    required=True,
    help="Time for which each side of the step is recorded.",
)
@click.option(
    "--velocity", type=float, default=0.0, help="Velocity of a step of position, in turns/s of the rotor."
)
@click.option(
    "--acceleration",
    type=float,
    default=0.0,
    help="Acceleration of a step of position, in turns/s² of the rotor.",
)
@click.option("--pos-gain", type=float, help="Gain in (turns/s)/turn.")
@click.option("--vel-gain", type=float, help="Gain in N·m per turn/s; needs --vel-integrator-gain.")
@click.option(
    "--vel-integrator-gain",
    type=float,
    help="Gain in N·m per turn; the procedure of the manual begins with 0.",
)
@click.option(
    "--raise-to",
    type=float,
    metavar="GAIN",
    help="The manual's method: raise the gain by 30 % each time, up to this value, until it is too high; then lower it.",
)
@module_options
@yes_option
def command(
    asked: ModuleSelection,
    loop: str,
    size: float,
    seconds: float,
    velocity: float,
    acceleration: float,
    pos_gain: float | None,
    vel_gain: float | None,
    vel_integrator_gain: float | None,
    raise_to: float | None,
    yes: bool,
) -> int:
    """Try gains: THE OUTPUT TURNS. The command explains the trial and asks for confirmation, then makes a step forward and back
    and measures both. It saves nothing.

    It shows overshoot, settling and ripple, and the next step that the manual recommends. With --raise-to it takes these steps,
    one trial after the other, and asks before each. Given gains are first written into RAM; with --list the previous gains are
    shown, and the new ones read back. Ctrl-C, SIGTERM, an error, a lost module, and a rotor that goes too far or too fast end
    it by velocity 0, idle, then ESTOP. Exit code 0 only if both sides were measured, and with --raise-to if a gain was found.
    """
    require_can(asked, "the step is commanded and measured over CAN")
    node = require_node(asked.node)
    require_bus(asked.line)
    gains = Gains(pos_gain, vel_gain, vel_integrator_gain)
    trial = ModuleTrial(node, Loop(loop), size, seconds, velocity, acceleration)
    if asked.listed is not None:
        require_list(asked)
    search = None if raise_to is None else search_for(trial, gains, raise_to)
    ask([*explanation(trial), *([] if search is None else explained(search))], yes=yes)
    before = _before(asked)
    if search is None:
        return _once(asked, trial, gains, before)
    code, gains = run_search(asked, trial, gains, search, yes=yes)
    if code == FAILURE:  # the module may be lost
        _tell_where_they_are(gains)
        return code
    return code if _tell_gains(asked, gains, before, _before(asked)) else FAILURE


def _once(asked: ModuleSelection, trial: ModuleTrial, gains: Gains, before: dict[str, float]) -> int:
    tuning, number = try_once(asked, trial, gains)
    code = tell(tuning)
    end_by(number)
    if code == FAILURE:
        _tell_where_they_are(gains)
        return code
    after = _before(asked)
    if not _tell_gains(asked, gains, before, after):
        return FAILURE
    if code == OK:
        _advise(tuning, gains, after)
    return code


def _before(asked: ModuleSelection) -> dict[str, float]:
    """Return the present gains of the module, if a list is given to read them by."""
    if asked.listed is None:
        return {}
    with opened(asked) as module:
        return {name: float(module.read(path)) for name, path in _PATHS.items()}


def _tell_where_they_are(gains: Gains) -> None:
    if gains.given:
        say("  note: the gains that were tried may be in its RAM; its next start restores the old ones")


def _tell_gains(
    asked: ModuleSelection, gains: Gains, before: dict[str, float], after: dict[str, float]
) -> bool:
    """Print the gains before and now; return whether the module has the given gains, as far as they can be read."""
    if not before:
        if gains.given:
            say(
                f"  note: nothing confirms the gains that were sent ({', '.join(gains.given)}): give --list to read them back"
            )
        return True
    for name, path in _PATHS.items():
        say(f"  {path}: {before[name]:.6g} before, {after[name]:.6g} now")
    changed = [f"{_PATHS[name]}={value:.9g}" for name, value in before.items() if after[name] != value]
    if changed:
        say("in RAM only: the next start restores the old ones, and so does")
        say(f"  axisbus gim6010 params set {' '.join(changed)} {asked.words}")
    return _were_taken(gains, after)


def _were_taken(gains: Gains, after: dict[str, float]) -> bool:
    lost = [_PATHS[name] for name, value in gains.given.items() if not values.same(after[name], value)]
    if lost:
        say_error(
            f"the module has not accepted {', '.join(lost)}: the step was made with other gains than those given"
        )
    return not lost


def _advise(tuning: ModuleTuning, gains: Gains, now: dict[str, float]) -> None:
    loop, found = tuning.trial.loop, worse(tuning.there, tuning.back)
    assert found is not None
    say_next(following(loop, found, gains.given.get(loop.value, now.get(loop.value))))


# -- The trials of ``axisbus gim6010 tune``: one, or the manual's procedure from gain to gain, confirmed before each ----


_INTEGRATOR = (
    "for vel_integrator_gain the manual has 0.5 x bandwidth x vel_gain, the bandwidth being 1 / the time in which a commanded "
    "position is reached (10 ms: 100 Hz); the position loop comes before that"
)


def try_once(asked: ModuleSelection, trial: ModuleTrial, gains: Gains) -> tuple[ModuleTuning, int]:
    """Make one trial with exclusive use of the bus; return it, and the signal that ended it (0: none). Blocks.

    Raises:
        BusError: another program uses the bus, or it cannot be opened.
    """
    tuning = ModuleTuning(trial, gains, remote=not without_remote(asked.line))
    return tuning, run_alone(asked.line, tuning)


def tell(tuning: ModuleTuning) -> int:
    """Print the result of a trial; return its exit code."""
    if not tuning.ended:
        say_error(f"the trial was not completed: {tuning.why}\n  observed: {tuning.left}")
        return FAILURE
    for name, response in (("there", tuning.there), ("back", tuning.back)):
        say(f"  {name + ':':<7}{'too few samples for a measurement' if response is None else response}")
    say(tuning.left)
    if not tuning.confirmed:
        return FAILURE
    return OK if tuning.there is not None and tuning.back is not None else WRONG


def search_for(trial: ModuleTrial, gains: Gains, most: float) -> GainSearch:
    """Return the search from the given gain up to ``most``.

    Raises:
        UsageError: the initial gain is not given.
        ArgumentError: it is invalid, or above ``most``.
    """
    first = getattr(gains, trial.loop.value)
    if first is None:
        option = "--pos-gain" if trial.loop.value == "position" else "--vel-gain and --vel-integrator-gain"
        raise click.UsageError(f"--raise-to needs a first gain: give {option}")
    return GainSearch(trial.loop, first, most)


def explained(search: GainSearch) -> Iterator[str]:
    """Yield the explanations of a search that are not part of those of one trial."""
    yield (
        f"  this is repeated, at most {MOST_TRIALS} times: {search.name} from {search.first:g} on, 30 % more each "
        f"time, up to {search.most:g}"
    )
    yield "  IT IS RAISED UNTIL THE MACHINE OSCILLATES OR OVERSHOOTS, then lowered; nothing is saved"


def run_search(
    asked: ModuleSelection, trial: ModuleTrial, gains: Gains, search: GainSearch, *, yes: bool
) -> tuple[int, Gains]:
    """Make trials until the search ends, one fails, or the user declines; return the exit code and the last gains.

    Raises:
        KeyboardInterrupt, SystemExit: there was a signal; the module has been released before.
    """
    while search.next is not None:
        if search.trials and not yes and not click.confirm(f"Continue with {search.name} {search.next:.4g}?"):
            say(f"ended by your answer no; {_so_far(search)}")
            return FAILURE, gains
        gains = replace(gains, **{trial.loop.value: search.next})
        say(f"{search.name} {search.next:.4g}:")
        tuning, number = try_once(asked, trial, gains)
        code = tell(tuning)
        found = worse(tuning.there, tuning.back)
        if code != OK or number or found is None:
            say_error(
                f"  the search ends here, with {search.name} {search.next:.4g} in its RAM; {_so_far(search)}"
            )
            end_by(number)
            return code or FAILURE, gains
        search.take(found)
    return _tell_end(search), gains


def _tell_end(search: GainSearch) -> int:
    say(f"{search.ends}; this value is in its RAM")
    if search.best is None:
        say_error(f"  no {search.name} was found that is smooth: look for play, friction and loose parts")
        return WRONG
    if search.name == "vel_gain":
        say_next(_INTEGRATOR)
    return OK


def _so_far(search: GainSearch) -> str:
    return (
        f"no {search.name} was smooth yet"
        if search.best is None
        else f"{search.name} {search.best:.4g} was smooth"
    )
