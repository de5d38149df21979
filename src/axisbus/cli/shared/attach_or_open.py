"""The machine of a cell for a command: joined if it runs on this computer, else opened for the command; frames of its bus."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import click

from axisbus.cia301.frame import CanFrame
from axisbus.cli.shared.common import echo
from axisbus.errors import StateError
from axisbus.machine.machine import Machine
from axisbus.machine.opening import out_of_reach, runs

take_option = click.option(
    "--take",
    is_flag=True,
    help="If the machine is already running, take control from the program that has it: all moving axes halt first.",
)


def machine_of(
    cell: Path,
    *,
    command: bool,
    take: bool = False,
    beside: bool = False,
    before: Callable[[], object] = lambda: None,
) -> Machine:
    """Return the machine of a cell: joined if it already runs, which is reported, else opened, after ``before``.

    Raises:
        OwnershipError: control is needed, and another program has it.
        Other errors as ``Machine.open``.
    """
    machine = join(cell, command, take)
    if machine is not None:
        return machine
    before()
    return Machine.open(cell, allow_other_master=beside)


def require_none_runs(cell: Path) -> None:
    """Check that no machine of a simulated cell runs: this command would simulate drives of its own.

    Raises:
        StateError: one runs.
    """
    if runs(cell):
        raise StateError(
            f"a machine of {cell} runs on this computer, and this command cannot join it",
            observed="its drives are simulated, on a bus that no other program can join",
            remedy=f"end that machine first; or use commands that join it: axisbus monitor {cell}, axisbus od, axisbus nmt",
        )


def running(cell: Path, verb: str, why: str, remedy: str, *, command: bool, take: bool = False) -> Machine:
    """Return the running machine of a cell.

    Raises:
        StateError: none runs, so the command makes no sense, because of ``why``; ``remedy``: what to do instead.
    """
    machine = join(cell, command, take)
    if machine is None:
        raise no_machine(cell, verb, why, remedy)
    return machine


def no_machine(cell: Path, verb: str, why: str, remedy: str) -> StateError:
    """Return the error of a command that needs a running machine, as for ``running``."""
    return StateError(
        f"no machine of {cell} is running on this computer, and {verb} {why}",
        observed=out_of_reach(cell),
        remedy=f"{remedy}; a machine that is just starting can be joined after it has booted",
    )


def join(cell: Path, command: bool, take: bool) -> Machine | None:
    """Return the running machine of a cell, which is reported; None if none runs.

    Raises:
        OwnershipError: control is needed, and another program has it.
    """
    machine = Machine.try_attach(cell, command=command, force=take)
    if machine is not None:
        has = "this command has" if command else f"{machine.control_owner or 'nobody'} has"
        echo(f"joined the running machine; {has} control", err=True)
    return machine


# -- Frames of a bus whose machine already runs, as its core reports them: in both directions, without a second adapter ----

_SLICE = 0.1  # seconds between two checks whether the machine still runs


def frames_of_machine(stack: ExitStack, cell: Path, seconds: float | None) -> Iterator[CanFrame] | None:
    """Return the frames of a cell's running machine for ``seconds`` (None: to its end); None if none runs.

    ``stack`` leaves the machine.

    Raises:
        ScanError, StateError: the machine cannot be joined.
    """
    machine = join(cell, command=False, take=False)
    if machine is None:
        return None
    stack.enter_context(machine)
    return frames_of(stack, machine, seconds)


def frames_of(
    stack: ExitStack, machine: Machine, seconds: float | None, can_ids: Collection[int] = ()
) -> Iterator[CanFrame]:
    """Return the frames of a machine from now on, those of ``can_ids`` or all, as above; ``stack`` ends the subscription."""
    frames_queue: queue.Queue[Sequence[CanFrame]] = queue.Queue()
    on_frames = frames_queue.put
    machine.session.tap(on_frames, can_ids)
    stack.callback(machine.session.untap, on_frames)
    return _frames(machine, frames_queue, seconds)


def _frames(
    machine: Machine, frames_queue: queue.Queue[Sequence[CanFrame]], seconds: float | None
) -> Iterator[CanFrame]:
    until = None if seconds is None else time.monotonic() + seconds
    while until is None or time.monotonic() < until:
        try:
            yield from frames_queue.get(timeout=_SLICE)
        except queue.Empty:
            if machine.session.ended:
                return
