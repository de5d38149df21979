"""Keeping the lifeline of a core: what its warden needs to stop its drives, noted after each cycle, and whether that warden runs.

Theory of operation
-------------------
The warden sends a byte every ``BEAT`` seconds. A byte that stays away may be a warden that was stopped (SIGSTOP, a debugger) or
hangs, and then nobody would stop the axes in the core's place; or a computer that is too busy to let it run. So only time counts in
which the core itself looked in time, and a warden that waits for a processor or a disk is given longer.
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
NOBODY = "nobody would stop the axes in its place"
_SILENCE = 0.6  # seconds without a byte
_STARVED = 5.0  # the same of a warden that waits
_ON_TIME = 3 * BEAT  # seconds between two looks; more shows that this computer did not run
_WAITING = ("R", "D")  # states of a process that would run: for a processor, for a disk (proc(5))
_SEEN = 2  # looks at which it does not wait: at the first one its byte may be on its way


class WardenWatch:
    """Judges by the bytes of a warden whether it runs; holds for how long none has come. Times in seconds."""

    def __init__(self, now: float, state: Callable[[], str]) -> None:
        """``state`` returns the state of the warden's process, a letter of proc(5), empty where it is not known."""
        self._state = state
        self._before = now
        self._silent = 0.0
        self._seen = 0

    def look(self, now: float, came: bool) -> str | None:
        """Return why axes must be stopped now, None while the warden runs; ``came``: a byte, since the last look."""
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
            return f"the warden of the core has not answered for {self._silent:.1f} s: {NOBODY}"
        if waits and self._silent > _STARVED:
            return f"this computer has not let the warden of the core run for {self._silent:.1f} s: {NOBODY}"
        return None


def state_of(process: int) -> str:
    """Return the state of a process as a letter of proc(5), empty where it is not known."""
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
    """Notes what was sent last, and which axes were commanded; holds the axes that it knows. Belongs to the scan's thread.

    Virtual axes are none of its own: there is no drive that would go on without the core. Of a module there is no frame to be kept:
    what stops it is the same at any time, and a rescue makes it.
    """

    def __init__(self, memory: mmap.mmap, at: int, core: Core, names: Sequence[str]) -> None:
        """``names``: of all axes of the cell, as they are numbered."""
        self._writer = LifelineWriter(memory, at)
        self._core = core
        self._numbers = {name: number for number, name in enumerate(names)}
        self._known: dict[str, tuple[int, AxisCore, CanPort | None]] = {}
        self._virtual = core.cell.axes.keys() - core.cell.driven.keys()
        for name in (name for name in core.scan.axes if name not in self._virtual):
            self._enter(name)

    def stage(self, stage: CoreStage) -> None:
        """Say how far the core is; before the scan begins, and after it has ended."""
        self._writer.stage(stage)

    def after_cycle(self, _now: float, snapshots: Mapping[str, Snapshot]) -> None:
        """Note what this cycle has sent; does not block."""
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
