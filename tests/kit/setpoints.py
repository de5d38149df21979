"""Set-points at the input of a drive."""

from __future__ import annotations

from kit.cell import SCALE, Cell

PP = 1


def edges(cell: Cell) -> list[float]:
    """The target, in degrees, that the drive has at every rising edge of bit 4 from now on."""
    seen: list[float] = []
    mode = cell.drive()._all_modes[PP]
    present = mode._present

    def watched(axis, word: int) -> None:
        seen.append(axis.target_position / SCALE)
        present(axis, word)

    mode._present = watched
    return seen
