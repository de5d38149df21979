"""Maintain the lifeline of a core: the data for a rescue, stored after each cycle, and the check that its watchdog process runs.

Theory of operation
-------------------
The watchdog process sends a byte every ``BEAT`` seconds. A missing byte may mean that the process was stopped (SIGSTOP, a debugger)
or hangs; then nothing would stop the axes in place of the core. Or the computer is too busy to run it. Therefore only time counts
in which the core itself checked on time, and a watchdog process that waits for a processor or a disk gets more time.
"""

from __future__ import annotations

import mmap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from axisbus.bus.port import CanPort
from axisbus.core.core import Core
from axisbus.ipc.rescue_memory import NO_WORD, CoreStage, LifelineWriter, RescueRpdo
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.snapshot import Snapshot

BEAT = 0.1  # seconds
NOBODY = "if the core fails, nothing stops the axes"
_SILENCE = 0.6  # seconds without a byte
_STARVED = 5.0  # the same for a watchdog process that waits
_ON_TIME = 3 * BEAT  # seconds between two checks; more shows that this computer did not run
_WAITING = ("R", "D")  # states of a process that waits for a processor or for a disk (proc(5))
_SEEN = 2  # checks without waiting: at the first one its byte may be on its way


class WardenWatch:
    """Decides by the bytes of a watchdog process whether it runs; holds the time without a byte. Times in seconds."""

    def __init__(self, now: float, state: Callable[[], str]) -> None:
        """``state`` returns the state of its process, a letter of proc(5), empty if unknown."""
        self._state = state
        self._before = now
        self._silent = 0.0
        self._seen = 0

    def look(self, now: float, came: bool) -> str | None:
        """Return why axes must be stopped now, None while the process runs; ``came``: a byte, since the last check."""
        passed, self._before = now - self._before, now
        if came:
            self._silent, self._seen = 0.0, 0
            return None
        self._silent += passed if passed < _ON_TIME else 0.0
        if self._silent <= _SILENCE:
            return None
        waits = self._state() in _WAITING
        self._seen = 0 if waits else self._seen + 1
        if self._seen >= _SEEN:
            return f"the watchdog process of the core has not answered for {self._silent:.1f} s: {NOBODY}"
        if waits and self._silent > _STARVED:
            return (
                f"the watchdog process of the core got no processor time for {self._silent:.1f} s: {NOBODY}"
            )
        return None


def state_of(process: int) -> str:
    """Return the state of a process as a letter of proc(5), empty if unknown."""
    try:
        return (
            Path(f"/proc/{process}/stat")
            .read_text(encoding="ascii", errors="replace")
            .rpartition(")")[2]
            .split()[0]
        )
    except (OSError, IndexError):
        return ""


class Lifeline:
    """Stores the last sent frames, and the commanded axes; holds the axes that it has entered. Belongs to the scan's thread.

    Virtual axes are not included: no drive would keep moving without the core. For a module no frame is stored: the frames that
    stop it are always the same, and a rescue makes them.
    """

    def __init__(self, memory: mmap.mmap, at: int, core: Core, names: Sequence[str]) -> None:
        """``names``: all axes of the cell, in the order of their numbers."""
        self._writer = LifelineWriter(memory, at)
        self._core = core
        self._numbers = {name: number for number, name in enumerate(names)}
        self._known: dict[str, tuple[int, AxisCore, CanPort | None]] = {}
        self._virtual = core.cell.axes.keys() - core.cell.driven.keys()
        for name in (name for name in core.scan.axes if name not in self._virtual):
            self._enter(name)

    def stage(self, stage: CoreStage) -> None:
        """Store the stage of the core; before the scan begins, and after it has ended."""
        self._writer.stage(stage)

    def after_cycle(self, _now: float, snapshots: Mapping[str, Snapshot]) -> None:
        """Store the frames of this cycle; does not block."""
        if len(snapshots) > len(self._known) + len(self._virtual):
            for name in snapshots.keys() - self._known.keys() - self._virtual:
                self._enter(name)
        for number, axis, port in self._known.values():
            if axis.touched:
                self._writer.touched(number)
                if port is not None:
                    self._writer.sent(port.committed)

    def _enter(self, name: str) -> None:
        port = self._core.runtime.ports[name]
        number = self._numbers[name]
        if not isinstance(port, CanPort):
            self._writer.enter([RescueRpdo(number)])
            self._known[name] = number, self._core.scan.axes[name], None
            return
        words, offsets = dict(port.controlwords), dict(port.cleared_bits)
        held = [
            RescueRpdo(number, cob_id, words.get(cob_id, NO_WORD), offsets.get(cob_id, 0))
            for cob_id in offsets | words
        ]
        self._writer.enter(held or [RescueRpdo(number)])
        self._known[name] = number, self._core.scan.axes[name], port
