"""The machine of a cell, followed: the one that runs, and the next one where it ends; told once, not at each look."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine

Look = Callable[[], object]
_WAIT = 0.5  # seconds between two looks for a machine
_TOLD = 0.05  # seconds in which a machine has told whoever has joined it how it is


class MachineFollower:
    """Joins one machine of a cell after the other; holds what it said last. ``run`` blocks."""

    def __init__(self, cell: Path, say: Callable[[str], None]) -> None:
        """``cell``: its file. ``say`` tells people how it goes."""
        self._cell = cell
        self._say = say
        self._said = ""

    def run(
        self,
        serve: Callable[[Machine], AbstractContextManager[Look]],
        every: float,
        goes_on: Callable[[], bool] = lambda: True,
    ) -> None:
        """Follow them until ``goes_on`` says no, or it is interrupted.

        ``serve`` has what is to be there while a machine is, and gives what is to be called ``every`` so many seconds. An
        AxisbusError of either is said, and the machine is joined anew.
        """
        while goes_on():
            try:
                self._follow(serve, every, goes_on)
            except AxisbusError as error:
                self._once(f"no machine is followed: {error.message}")
            time.sleep(_WAIT)

    def _follow(
        self,
        serve: Callable[[Machine], AbstractContextManager[Look]],
        every: float,
        goes_on: Callable[[], bool],
    ) -> None:
        """Serve the machine of the cell until it ends; return at once where none runs."""
        machine = Machine.try_attach(self._cell)
        if machine is None:
            self._once("waits for a machine: axisbus run")
            return
        time.sleep(_TOLD)
        if _ends(machine):
            machine.close()
            return
        with machine, serve(machine) as look:
            self._once("joined the machine that runs")
            while not machine.session.ended:
                if not goes_on():
                    return
                look()
                machine.sleep(every)
        self._once("the machine has ended")

    def _once(self, text: str) -> None:
        if text != self._said:
            self._said = text
            self._say(text)


def _ends(machine: Machine) -> bool:
    """Whether a machine is on its way out: it lets programs in to its end, and there is nothing to follow."""
    return machine.session.ended or machine.session.leaving_because is not None
