"""Frames of a bus whose machine runs already, as its core tells them: in both directions, and without a second adapter."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

from axisbus.cia301.frame import Frame
from axisbus.cli.shared.joining import join
from axisbus.machine.machine import Machine

_SLICE = 0.1  # seconds between two looks whether the machine is still there


def frames_of_machine(stack: ExitStack, cell: Path, seconds: float | None) -> Iterator[Frame] | None:
    """Return the frames of the machine of a cell for so long (None: until it ends); None where none runs. ``stack`` leaves it.

    Raises:
        ScanError, StateError: it cannot be joined.
    """
    machine = join(cell, command=False, take=False)
    if machine is None:
        return None
    stack.enter_context(machine)
    told: queue.Queue[Sequence[Frame]] = queue.Queue()
    machine.session.tap(told.put)
    stack.callback(machine.session.untap, told.put)
    return _frames(machine, told, seconds)


def _frames(machine: Machine, told: queue.Queue[Sequence[Frame]], seconds: float | None) -> Iterator[Frame]:
    until = None if seconds is None else time.monotonic() + seconds
    while until is None or time.monotonic() < until:
        try:
            yield from told.get(timeout=_SLICE)
        except queue.Empty:
            if machine.session.ended:
                return
