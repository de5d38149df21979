"""The bus of a command: search its modules, where a wrong bit rate is detected silently, or run a procedure that moves one."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING

import click

from axisbus.cli.shared import no_traffic_help
from axisbus.cli.shared.buses import open_bus, opening_of, require_rate
from axisbus.cli.shared.common import say
from axisbus.cli.shared.options import Decorated, GivenBus, bus_options, packed, parse_options
from axisbus.drives.gim6010.discovery.finder import EVERY_NODE, Finder, ProbeScope
from axisbus.drives.gim6010.discovery.results import DiscoveredModule, findings
from axisbus.errors import StateError
from axisbus.system.signals import present

if TYPE_CHECKING:
    from axisbus.bus.link.other_rates import BitRateTraffic
    from axisbus.drives.gim6010.bus.run import Interruptible

_LISTEN = 1.2  # s in listen-only mode at the given bit rate


def line_options(function: Decorated) -> Decorated:
    """Add the bus options to a command, as the outermost of its options; it gets them together as ``line``."""
    return bus_options(packed(partial(GivenBus, None), "line")(function))


def require_bus(line: GivenBus) -> None:
    """Refuse a missing bus or bit rate. Raises UsageError: one of them is missing."""
    if line.interface is None:
        raise click.UsageError("give the bus with -i and -c (such as: -i socketcan -c can0)")
    if line.interface != "sim":
        require_rate(line.interface, line.bitrate, parse_options(line.option))


def require_node(node: int | None) -> int:
    """Return the node ID of the option --node. Raises UsageError: it is not given."""
    if node is None:
        raise click.UsageError("give the module's node ID with --node (axisbus gim6010 find shows it)")
    return node


def without_remote(line: GivenBus) -> bool:
    from axisbus.drives.gim6010.cell import NO_REMOTE

    return line.interface in NO_REMOTE


def look(line: GivenBus, finder: Finder, *, quiet: bool = False) -> BitRateTraffic | None:
    """Run ``finder`` on a bus; if traffic is received only at another bit rate, send nothing and return that traffic.

    An adapter with a listen-only mode listens in it first. Blocks some seconds.

    Raises:
        UsageError, AdapterError, ConfigError: the bus cannot be opened.
    """
    require_bus(line)
    finder.remote = not without_remote(line)
    from axisbus.bus.link import other_rates

    # an adapter that can listen at any bit rate without sending
    if other_rates.possible(line.interface or "", parse_options(line.option)) and not _heard(line):
        elsewhere = no_traffic_help.listen(opening_of(*line), quiet=quiet)
        if elsewhere is not None:
            return elsewhere
    from axisbus.drives.gim6010.bus.run import run

    with ExitStack() as stack:
        run(open_bus(stack, *line), finder)
    return None


def _heard(line: GivenBus) -> bool:
    """Whether any frame is received at the given bit rate, in listen-only mode."""
    from axisbus.bus.link import adapter
    from axisbus.bus.link.listen import listen

    options = adapter.forced(line.interface or "", parse_options(line.option))
    with listen(line.interface or "", line.channel, line.bitrate, options) as listener:
        return any(not frame.error for frame in listener.frames(_LISTEN))


def survey(line: GivenBus, node: int | None = None) -> tuple[Finder, tuple[DiscoveredModule, ...]]:
    """Query all node IDs on a bus, or only one, and return the finder with its results; error words are not requested.

    Raises:
        UsageError, AdapterError, ConfigError: as ``look``.
        StateError: the bus runs at another bit rate.
    """
    finder = Finder(ask=ProbeScope.ALL, only=EVERY_NODE if node is None else (node,), words=False)
    elsewhere = look(line, finder)
    if elsewhere is not None:
        raise StateError(
            f"this bus runs at {elsewhere.bitrate} bit/s, not at {line.bitrate}",
            remedy=f"give -b {elsewhere.bitrate}",
        )
    return finder, findings(finder)


def run_alone(line: GivenBus, procedure: Interruptible) -> int:
    """Run a procedure that moves a module, as the only program on the bus; return the signal that ended it (0: none). Blocks.

    Raises:
        BusError: another program uses the bus, or it cannot be opened.
    """
    from axisbus.bus.link import ownership
    from axisbus.drives.gim6010.bus.run import run_guarded

    with ExitStack() as stack:
        lock = ownership.take(line.interface or "", line.channel)
        if lock is not None:
            stack.enter_context(lock)
        return run_guarded(open_bus(stack, *line), procedure, say)


# -- Confirmation before an automatic motion: explain it, and require the user's consent -------------------------------


yes_option = click.option("--yes", is_flag=True, help="Skip the confirmation prompt: all conditions are met.")


def ask(explanation: Iterable[str], *, yes: bool) -> None:
    """Print what will happen, and continue only if the user agrees.

    Raises:
        UsageError: there is no terminal to answer, and ``--yes`` is not given.
        Abort: the user declines.
    """
    for line in explanation:
        say(line)
    if yes:
        return
    if not sys.stdin.isatty():
        raise click.UsageError(
            "no terminal to answer the question: give --yes, if all of these conditions are met"
        )
    click.confirm("Start now?", abort=True)


def end_by(number: int) -> None:
    """End the program as the signal with this number requires; 0: there was no signal.

    Raises:
        KeyboardInterrupt, SystemExit: there was one.
    """
    if number in present("SIGINT", "SIGTSTP"):
        raise KeyboardInterrupt
    if number:
        raise SystemExit(128 + number)
