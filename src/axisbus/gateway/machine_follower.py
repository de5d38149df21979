"""Follow the machine of a cell: join the running one, and the next one when it ends; report each change once."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from axisbus.core.process.launch import require_joinable_system
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine

Look = Callable[[], object]
_WAIT = 0.5  # seconds between two attempts to find a machine
_TOLD = 0.05  # seconds within which a machine has sent its state to a new client


class MachineFollower:
    """Join one machine of a cell after the other; holds the last report. ``run`` blocks."""

    def __init__(self, cell: Path, say: Callable[[str], None]) -> None:
        """``cell``: the cell file. ``say`` reports the progress to people. Raises PlatformError: no machine can be joined here."""
        require_joinable_system()
        self._cell = cell
        self._say = say
        self._said = ""

    def run(
        self,
        serve: Callable[[Machine], AbstractContextManager[Look]],
        every: float,
        goes_on: Callable[[], bool] = lambda: True,
    ) -> None:
        """Follow the machines until ``goes_on`` returns false, or it is interrupted.

        ``serve`` is a context for the time with a machine; it returns a function that is called every ``every`` seconds. An
        AxisbusError of either is reported, and the machine is joined again.
        """
        while goes_on():
            try:
                self._follow(serve, every, goes_on)
            except AxisbusError as error:
                self._once(f"no machine is observed: {error.message}")
            time.sleep(_WAIT)

    def _follow(
        self,
        serve: Callable[[Machine], AbstractContextManager[Look]],
        every: float,
        goes_on: Callable[[], bool],
    ) -> None:
        """Serve the machine of the cell until it ends; return at once if none runs."""
        machine = Machine.try_attach(self._cell)
        if machine is None:
            self._once("waits for a machine: axisbus run")
            return
        time.sleep(_TOLD)
        if _ends(machine):
            machine.close()
            return
        with machine, serve(machine) as look:
            self._once("joined the running machine")
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
    """Whether a machine is shutting down: it admits programs until its end, but there is nothing to follow."""
    return machine.session.ended or machine.session.leaving_because is not None
