"""What a warden is told by who starts it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class StartupArgs:
    """What a warden is told by who starts it: descriptors (-1: none), the cell's file, and how many axes it has.

    ``line`` leads from the core to its program and ``tell`` from the warden to it. Where drives are simulated, ``drives`` is the
    core's end of the line to them and ``far`` their own, and ``control`` leads from them to the program. ``lock`` says that this
    machine runs, keeps others off the adapter, and lets clients in; ``mark`` shows that its link is open. Out of ``signals`` the
    program takes its own. Its end of ``line`` has the number ``end`` there, and ``inode``.
    """

    line: int
    memory: int
    tell: int
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
        """Whether there are drives to be simulated."""
        return self.far >= 0

    @property
    def of_core(self) -> set[int]:
        """The descriptors of the core."""
        return self._there(self.line, self.memory, self.signals, self.drives, self.lock, self.mark)

    @property
    def of_drives(self) -> set[int]:
        """The descriptors of the simulated drives."""
        return self._there(self.far, self.control)

    @property
    def of_warden(self) -> set[int]:
        """The descriptors of the warden itself."""
        return self._there(self.tell, self.memory, self.drives, self.lock, self.mark)

    @property
    def all(self) -> set[int]:
        """The descriptors of all of them."""
        return self.of_core | self.of_drives | self.of_warden

    def _there(self, *numbers: int) -> set[int]:
        return {number for number in numbers if number >= 0}
