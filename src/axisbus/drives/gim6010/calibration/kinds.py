"""Calibrations of a module, and the motion that each causes, as text for the operator (manual v2.2, 3.1.4)."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum

from axisbus.drives.gim6010.can_simple.states import state_words
from axisbus.drives.gim6010.make import GEAR_RATIO

_MOTOR_STATE, _ENCODER_STATE = 4, 7


class CalibrationKind(Enum):
    """A calibration by the state that starts it; ``parts`` are the states that must be seen, since 3 is never reported."""

    MOTOR = 4
    ENCODER = 7
    FULL = 3

    @property
    def words(self) -> str:
        """Name of the calibration."""
        return state_words(self.value)

    @property
    def parts(self) -> frozenset[int]:
        """States that the calibration must pass through."""
        return (
            frozenset({_MOTOR_STATE, _ENCODER_STATE})
            if self is CalibrationKind.FULL
            else frozenset({self.value})
        )

    @property
    def turns(self) -> bool:
        """Whether it turns the output."""
        return _ENCODER_STATE in self.parts

    @property
    def farthest(self) -> float:
        """Rotor turns from the start at which it is aborted: no source gives the angle of a calibration."""
        return float(GEAR_RATIO) if self.turns else 1.0


# States that may appear during a calibration; 0 is a state of newer firmware, truncated to four bits.
ON_THE_WAY = frozenset({0, 3, 4, 6, 7, 10, 12, 13, 14, 15, 16})
_PARTS = {
    _MOTOR_STATE: "the motor: current flows for some seconds at standstill, with a sharp beep; the rotor may twitch",
    _ENCODER_STATE: "the encoder: the rotor turns slowly without a command, forward through an angle and back again",
}


def explanation(kind: CalibrationKind, node: int, *, watchdog_process: bool = False) -> Iterator[str]:
    """Yield the motion to expect and the precautions; ``watchdog_process``: one ends it if the program is killed."""
    yield f"{kind.words} of module {node}, which moves without a command:"
    for part in sorted(kind.parts):
        yield f"  {_PARTS[part]}"
    if kind.turns:
        yield (
            "  no source gives the angle: the calibration is ended if the output has turned by more than one turn from its "
            "start position; keep that range free, in both directions"
        )
    yield "  take every load off the output, fasten the module, and keep hands away; have the supply's switch at hand"
    unended = (
        "a cable that breaks" if watchdog_process else "a program that is killed, or a cable that breaks,"
    )
    yield f"  Ctrl-C ends it; {unended} does not: it then continues to its end"
    yield (
        "  modules are calibrated at the factory, and owners advise against a repetition: with a wrong result the motor "
        "can run away"
    )
    yield "  the measured values stay in its RAM until they are saved, and this command saves nothing"
