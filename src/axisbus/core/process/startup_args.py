"""The start-up arguments of a watchdog process."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class StartupArgs:
    """The arguments of a watchdog process: descriptors (-1: none), the cell's file, and its number of axes.

    ``line`` leads from the core to its program, and ``report_line`` from the watchdog process to it. If drives are simulated,
    ``drives`` is the core's end of the line to them and ``far`` their own, and ``control`` leads from them to the program. ``lock``
    shows that this machine runs, reserves the adapter, and accepts clients; ``mark`` shows that its link is open. From ``signals``
    the program reads its signals. The program's end of ``line`` has the descriptor ``end`` there, and ``inode``.
    """

    DESCRIPTORS: ClassVar = (
        "line",
        "memory",
        "report_line",
        "signals",
        "drives",
        "far",
        "control",
        "lock",
        "mark",
    )

    line: int
    memory: int
    report_line: int
    program: int
    cell: str
    axes: int
    signals: int
    end: int
    inode: int
    drives: int = -1
    far: int = -1
    control: int = -1
    lock: int = -1
    mark: int = -1

    @property
    def simulates(self) -> bool:
        """Whether drives are simulated."""
        return self.far >= 0

    @property
    def of_core(self) -> set[int]:
        """The descriptors of the core."""
        return self._valid(self.line, self.memory, self.signals, self.drives, self.lock, self.mark)

    @property
    def of_drives(self) -> set[int]:
        """The descriptors of the simulated drives."""
        return self._valid(self.far, self.control)

    @property
    def of_watchdog(self) -> set[int]:
        """The descriptors of the watchdog process itself."""
        return self._valid(self.report_line, self.memory, self.drives, self.lock, self.mark)

    @property
    def all(self) -> set[int]:
        """The descriptors of all three."""
        return self.of_core | self.of_drives | self.of_watchdog

    def _valid(self, *numbers: int) -> set[int]:
        return {number for number in numbers if number >= 0}
