"""The trials of ``axisbus gim6010 tune``: one, or the manual's procedure from gain to gain, confirmed before each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.confirm import end_by
from axisbus.cli.gim6010.discovery import without_remote
from axisbus.cli.gim6010.params.module import ModuleSelection
from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_next

if TYPE_CHECKING:
    from axisbus.drives.gim6010.tuning.runner import ModuleTuning
    from axisbus.drives.gim6010.tuning.search import GainSearch
    from axisbus.drives.gim6010.tuning.trial import Gains, ModuleTrial

_INTEGRATOR = (
    "for vel_integrator_gain the manual has 0.5 x bandwidth x vel_gain, the bandwidth being 1 / the time in which a commanded "
    "position is reached (10 ms: 100 Hz); the position loop comes before that"
)


def try_once(asked: ModuleSelection, trial: ModuleTrial, gains: Gains) -> tuple[ModuleTuning, int]:
    """Make one trial with exclusive use of the bus; return it, and the signal that ended it (0: none). Blocks.

    Raises:
        BusError: another program uses the bus, or it cannot be opened.
    """
    from axisbus.bus.gim6010.run import run_guarded
    from axisbus.bus.link import ownership
    from axisbus.drives.gim6010.tuning.runner import ModuleTuning

    tuning = ModuleTuning(trial, gains, remote=not without_remote(asked.line))
    with ExitStack() as stack:
        lock = ownership.take(asked.line.interface or "", asked.line.channel)
        if lock is not None:
            stack.enter_context(lock)
        return tuning, run_guarded(open_bus(stack, None, *asked.line), tuning, say)


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
    from axisbus.drives.gim6010.tuning.search import GainSearch

    first = getattr(gains, trial.loop.value)
    if first is None:
        option = "--pos-gain" if trial.loop.value == "position" else "--vel-gain and --vel-integrator-gain"
        raise click.UsageError(f"--raise-to needs a first gain: give {option}")
    return GainSearch(trial.loop, first, most)


def explained(search: GainSearch) -> Iterator[str]:
    """Yield the explanations of a search that are not part of those of one trial."""
    from axisbus.drives.gim6010.tuning.search import MOST_TRIALS

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
    from axisbus.drives.gim6010.tuning.search import worse

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
