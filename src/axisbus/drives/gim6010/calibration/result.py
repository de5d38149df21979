"""Result of a calibration, judged by its states, the error words, and the motion of the rotor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.calibration.kinds import CalibrationKind
from axisbus.drives.gim6010.can_simple.heartbeat import Heartbeat
from axisbus.drives.gim6010.can_simple.states import state_words
from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN
from axisbus.drives.gim6010.make import GEAR_RATIO

_TURNS = 0.02  # rotor turns from which the encoder's calibration counts as having turned
_DEGREES = 360.0 / GEAR_RATIO


@dataclass(frozen=True, slots=True)
class CalibrationResult:
    """Whether the calibration succeeded; ``wrong`` are the reasons against it, ``notes`` further remarks."""

    good: bool
    wrong: tuple[str, ...]
    notes: tuple[str, ...]


def errors(beat: Heartbeat, words: Mapping[str, int]) -> list[str]:
    """Return a sentence for each error in a heartbeat and in the error words by category; empty if there is none."""
    told = {"axis": beat.axis_error, **words}
    found = [text for category, word in told.items() for text in faults.words(category, word)]
    return found + [f"{part}: its heartbeat reports a fault" for part in beat.faults if not told.get(part)]


def judge(
    kind: CalibrationKind,
    seen: Sequence[int],
    errors: Sequence[str],
    turned: RotorRotation,
    *,
    words_told: bool = True,
) -> CalibrationResult:
    """Judge a calibration that has ended, without being aborted, in idle.

    ``seen`` are its states, ``errors`` the reported errors, a sentence each; ``words_told``: the module reported its error words.
    """
    missing = [
        f"{state_words(part)} was not seen among its states" for part in sorted(kind.parts - set(seen))
    ]
    wrong = [*errors, *missing, *_turned_wrongly(kind, turned)]
    return CalibrationResult(not wrong, tuple(wrong), tuple(_notes(kind, turned, words_told=words_told)))


def _turned_wrongly(kind: CalibrationKind, turned: RotorRotation) -> list[str]:
    if not kind.turns or not turned.heard:
        return []
    if turned.farthest < _TURNS:
        return [f"the rotor was not seen to turn: {turned.farthest:.4f} rotor turns at the most"]
    if abs(turned.now) > turned.farthest / 2.0:
        return [
            f"the rotor turned by {turned.farthest:.2f} rotor turns and did not come back: {turned.now:.2f} rotor turns off"
        ]
    return []


def _notes(kind: CalibrationKind, turned: RotorRotation, *, words_told: bool) -> list[str]:
    notes = []
    if not words_told:
        notes.append("its error words are not available over CAN: only its heartbeat was checked")
    if kind.turns and not turned.heard:
        notes.append("the angle that it turned is not known: it does not report its encoder count")
    elif turned.heard:
        way = turned.high - turned.low
        notes.append(
            f"the rotor was seen to turn over {way:.2f} rotor turns, {way * _DEGREES:.0f} degrees of the output at {GEAR_RATIO}:1"
        )
    return notes


# -- Rotation of a rotor, from counts within one turn that are frequent enough to determine the direction --------------


@dataclass(slots=True)
class RotorRotation:
    """Rotor turns from the first count: now, and the extremes in both directions; ``heard``: number of counts."""

    now: float = 0.0
    low: float = 0.0
    high: float = 0.0
    heard: int = 0
    _count: int = 0

    def take(self, count: int) -> None:
        """Take a count (0 to 16383). The shorter direction is assumed: the rotor must turn less than half a turn between two."""
        if self.heard:
            step = (count - self._count + TURN // 2) % TURN - TURN // 2
            self.now += step / TURN
        self._count, self.heard = count, self.heard + 1
        self.low, self.high = min(self.low, self.now), max(self.high, self.now)

    @property
    def farthest(self) -> float:
        """Rotor turns between the first and the farthest position."""
        return max(self.high, -self.low)
