"""The modes of an axis as its objects and 6502h show them together, and the doubts where the two differ."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass

from axisbus.cell.described import Drive
from axisbus.cell.parameters import modes
from axisbus.cia402.modes import FACTS, ModeOfOperation, needed


@dataclass(frozen=True, slots=True)
class Shown:
    """The modes that both show (the objects alone, where 6502h says nothing), and in sentences what only one of them does."""

    modes: tuple[ModeOfOperation, ...]
    doubts: tuple[str, ...]


def of(drive: Drive, claimed: Set[ModeOfOperation] | None = None) -> Shown:
    """Return what is shown of an axis; ``claimed``: by the drive's own 6502h (None: by that of its EDS)."""
    if claimed is None:
        claimed = drive.claimed
    runnable = drive.runnable
    if claimed is None:
        return Shown(tuple(sorted(runnable)), ("6502h says nothing: by the objects alone",))
    doubts = [_missing(drive, mode) for mode in sorted(claimed - runnable)]
    unlisted = [FACTS[mode].short for mode in sorted(runnable - claimed)]
    if unlisted:
        it = "it" if len(unlisted) == 1 else "them"
        unused = "" if modes(drive, claimed) >= runnable else ": not used unless modes = [...] names it"
        doubts.append(f"objects of {', '.join(unlisted)} are there, but 6502h does not list {it}{unused}")
    return Shown(tuple(sorted(runnable & claimed)), tuple(doubts))


def _missing(drive: Drive, mode: ModeOfOperation) -> str:
    missing = drive.missing(needed(mode))
    names = ", ".join(f"{index:04X}h" for index in missing)
    return f"6502h claims {FACTS[mode].short}, but {names} {'is' if len(missing) == 1 else 'are'} missing"
