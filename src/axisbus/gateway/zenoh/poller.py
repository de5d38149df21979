"""Poll a machine for its events, and for the program that has control."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Callable

from axisbus.errors import AxisbusError
from axisbus.gateway.machine_events import MachineEventSource
from axisbus.gateway.zenoh.event_log import Happened
from axisbus.gateway.zenoh.event_mapping import told
from axisbus.gateway.zenoh.lease_manager import Holding
from axisbus.machine.machine import Machine

log = logging.getLogger("axisbus")
_EVERY = 0.25  # seconds
_LEAST = 0.05  # seconds between two polls, even if there is always something new
_BEGAN = 1e-3  # seconds by which the time stamps of a list may differ


class MachinePoller:
    """Poll in a thread of its own, which may wait for answers of the core; ``wake`` is for any thread."""

    def __init__(self, machine: Machine, holding: Holding, tell: Callable[[Happened], None]) -> None:
        self._machine = machine
        self._holding = holding
        self._tell = tell
        self._happenings = MachineEventSource(time.monotonic() - _BEGAN, commands=True)
        self._woken = threading.Event()
        self._over = False
        self._commander: str | None = None
        self._thread = threading.Thread(target=self._run, name="looking", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def wake(self) -> None:
        """Poll now; does not block."""
        self._woken.set()

    def close(self) -> None:
        """Poll once more, and end; blocks briefly."""
        self._over = True
        self._woken.set()
        self._thread.join(2.0)

    @property
    def commander(self) -> str | None:
        """The program at the machine that has control, other than this one; as of the last poll."""
        return self._commander

    def _run(self) -> None:
        while not self._over:
            self._woken.wait(_EVERY)
            self._woken.clear()
            try:
                self._look()
            except AxisbusError as error:  # the machine has ended, or is about to
                log.debug("the machine could not be observed: %s", error)
            except Exception:
                log.exception("an observation of the machine failed")
            time.sleep(_LEAST)

    def _look(self) -> None:
        for happened in told(self._happenings.look(self._machine, time.monotonic())):
            self._tell(happened)
        own = f"process {os.getpid()} "
        who = next((each.who for each in self._machine.programs if each.commands), None)
        self._commander = None if who is None or own in who else who
        guest = self._holding.guest
        if guest is not None and not guest.has_control:
            self._holding.lost(f"{who or 'another program'} took control of the machine")
