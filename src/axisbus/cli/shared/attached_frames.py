"""Frames of a bus whose machine already runs, as its core reports them: in both directions, without a second adapter."""

from __future__ import annotations

import queue
import time
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

from axisbus.cia301.frame import CanFrame
from axisbus.cli.shared.attach_or_open import join
from axisbus.machine.machine import Machine

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
    told: queue.Queue[Sequence[CanFrame]] = queue.Queue()
    hear = told.put
    machine.session.tap(hear, can_ids)
    stack.callback(machine.session.untap, hear)
    return _frames(machine, told, seconds)


def _frames(
    machine: Machine, told: queue.Queue[Sequence[CanFrame]], seconds: float | None
) -> Iterator[CanFrame]:
    until = None if seconds is None else time.monotonic() + seconds
    while until is None or time.monotonic() < until:
        try:
            yield from told.get(timeout=_SLICE)
        except queue.Empty:
            if machine.session.ended:
                return
