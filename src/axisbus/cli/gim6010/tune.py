"""``axisbus gim6010 tune``: try gains of a module by a step there and back, and measure the response."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.confirm import ask, end_by, yes_option
from axisbus.cli.gim6010.params.module import (
    ModuleSelection,
    module_options,
    opened,
    require_can,
    require_list,
)
from axisbus.cli.gim6010.tuning_trials import explained, run_search, search_for, tell, try_once
from axisbus.cli.shared.common import FAILURE, OK, say, say_error, say_next
from axisbus.cli.shared.numbers import Seconds

if TYPE_CHECKING:
    from axisbus.drives.gim6010.tuning.runner import ModuleTuning
    from axisbus.drives.gim6010.tuning.trial import Gains, ModuleTrial

_PATHS = {
    "position": "axis0.controller.config.pos_gain",
    "velocity": "axis0.controller.config.vel_gain",
    "integrator": "axis0.controller.config.vel_integrator_gain",
}


@click.command("tune")
@click.argument("loop", type=click.Choice(["position", "velocity"]))
@click.option("--step", "size", type=float, required=True, help="In turns of the rotor, or in turns/s of it.")
@click.option("--for", "seconds", type=Seconds(), required=True, help="How long each side is recorded.")
@click.option("--velocity", type=float, default=0.0, help="Of a step of position: turns/s of the rotor.")
@click.option("--acceleration", type=float, default=0.0, help="Of a step of position: turns/s² of the rotor.")
@click.option("--pos-gain", type=float, help="In (turns/s)/turn.")
@click.option("--vel-gain", type=float, help="In N·m per turn/s; with --vel-integrator-gain.")
@click.option("--vel-integrator-gain", type=float, help="In N·m per turn; the manual begins with 0.")
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
    """Try gains: THE OUTPUT TURNS. It makes a step forward and back and measures it; it explains and asks first, and saves
    nothing.

    It shows overshoot, settling and ripple, and the next step that the manual recommends. With --raise-to it takes these steps,
    one trial after the other, and asks before each. Given gains are set before, in RAM; with --list the previous gains are
    shown, and the new ones read back. Ctrl-C, SIGTERM, an error, a lost module, and a rotor that goes too far or too fast end
    it by velocity 0, idle, then ESTOP. Exit code 0 only if both sides were measured, and with --raise-to if a gain was found.
    """
    from axisbus.drives.gim6010.tuning.trial import Gains, Loop, ModuleTrial, explanation

    require_can(asked, "the step is commanded and measured over CAN")
    if asked.node is None:
        raise click.UsageError("give the module's node ID with --node (axisbus gim6010 find shows it)")
    asked.line.check()
    gains = Gains(pos_gain, vel_gain, vel_integrator_gain)
    trial = ModuleTrial(asked.node, Loop(loop), size, seconds, velocity, acceleration)
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
    if any(getattr(gains, name) is not None for name in _PATHS):
        say("  note: the gains that were tried may be in its RAM; its next start restores the old ones")


def _tell_gains(
    asked: ModuleSelection, gains: Gains, before: dict[str, float], after: dict[str, float]
) -> bool:
    """Print the gains before and now; return whether the module has the given gains, as far as they can be read."""
    if not before:
        given = [name for name in _PATHS if getattr(gains, name) is not None]
        if given:
            say(
                f"  note: nothing confirms the gains that were sent ({', '.join(given)}): give --list to read them back"
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
    from axisbus.drives.gim6010.parameters import values

    given = {name: getattr(gains, name) for name in _PATHS}
    lost = [
        _PATHS[name]
        for name, value in given.items()
        if value is not None and not values.same(after[name], value)
    ]
    if lost:
        say_error(
            f"the module has not accepted {', '.join(lost)}: the step was made with other gains than those given"
        )
    return not lost


def _advise(tuning: ModuleTuning, gains: Gains, now: dict[str, float]) -> None:
    from axisbus.drives.gim6010.tuning.search import following, worse

    loop, found = tuning.trial.loop, worse(tuning.there, tuning.back)
    assert found is not None
    given = getattr(gains, loop.value)
    say_next(following(loop, found, now.get(loop.value) if given is None else given))
