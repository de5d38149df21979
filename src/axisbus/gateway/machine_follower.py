"""Follow the machine of a cell: join the running one, and the next one when it ends; report each change once."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from axisbus.core.process.launch import require_joinable_system
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine

Poll = Callable[[], object]
_WAIT = 0.5  # seconds between two attempts to find a machine
_FIRST_STATE_TIME = 0.05  # seconds within which a machine has sent its state to a new client


class MachineFollower:
    """Join one machine of a cell after the other; holds the last report. ``run`` blocks."""

    def __init__(self, cell: Path, say: Callable[[str], None]) -> None:
        """``cell``: the cell file. ``say`` reports the progress to people. Raises PlatformError: no machine can be joined here."""
        require_joinable_system()
        self._cell = cell
        self._say = say
        self._last_text = ""

    def run(
        self,
        serve: Callable[[Machine], AbstractContextManager[Poll]],
        interval: float,
        may_continue: Callable[[], bool] = lambda: True,
    ) -> None:
        """Follow the machines until ``may_continue`` returns false, or it is interrupted.

        ``serve`` is a context for the time with a machine; it returns a function that is called every ``interval`` seconds. An
        AxisbusError of either is reported, and the machine is joined again.
        """
        while may_continue():
            try:
                self._follow(serve, interval, may_continue)
            except AxisbusError as error:
                self._say_if_new(f"no machine is observed: {error.message}")
            time.sleep(_WAIT)

    def _follow(
        self,
        serve: Callable[[Machine], AbstractContextManager[Poll]],
        interval: float,
        may_continue: Callable[[], bool],
    ) -> None:
        """Serve the machine of the cell until it ends; return at once if none runs."""
        machine = Machine.try_attach(self._cell)
        if machine is None:
            self._say_if_new("waits for a machine: axisbus run")
            return
        time.sleep(_FIRST_STATE_TIME)
        if _ends(machine):
            machine.close()
            return
        with machine, serve(machine) as poll:
            self._say_if_new("joined the running machine")
            while not machine.session.ended:
                if not may_continue():
                    return
                poll()
                machine.sleep(interval)
        self._say_if_new("the machine has ended")

    def _say_if_new(self, text: str) -> None:
        if text != self._last_text:
            self._last_text = text
            self._say(text)


def _ends(machine: Machine) -> bool:
    """Whether a machine is shutting down: it admits programs until its end, but there is nothing to follow."""
    return machine.session.ended or machine.session.leaving_because is not None
