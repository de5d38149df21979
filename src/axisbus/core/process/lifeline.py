"""Keeping the lifeline of a core: what its warden needs to stop its drives, noted after each cycle."""

from __future__ import annotations

import mmap
from collections.abc import Mapping, Sequence

from axisbus.bus.port import CanPort
from axisbus.core.owner import Core
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.snapshot import Snapshot
from axisbus.wire.lifeline import NO_WORD, Held, LifelineWriter, Stage


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

    def stage(self, stage: Stage) -> None:
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
            self._writer.enter([Held(number)])
            self._known[name] = number, self._core.scan.axes[name], None
            return
        words, offsets = dict(port.controlwords), dict(port.offset_bits)
        held = [
            Held(number, cob_id, words.get(cob_id, NO_WORD), offsets.get(cob_id, 0))
            for cob_id in offsets | words
        ]
        self._writer.enter(held or [Held(number)])
        self._known[name] = number, self._core.scan.axes[name], port
