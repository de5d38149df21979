"""Outputs sent so recently that the drive's inputs may not answer them yet."""

from __future__ import annotations

import math

from axisbus.cia402.controlword import PowerCommand
from axisbus.cia402.port import Outputs

# Scan periods: to the SYNC that makes the output effective, to the SYNC that samples the answer, and to the cycle that reads it;
# less half a period, because times do not add up exactly.
_ANSWERED = 2.5
_ENABLE = PowerCommand.ENABLE_OPERATION.word
_MODE_TAKEN = 3.5  # a drive evaluates 6060h in a slower task


class PendingOutputs:
    """Holds the last controlword (``word``) and mode that were sent, and their times in seconds of the scan's clock."""

    __slots__ = ("_enabled_until", "_mode", "_mode_since", "_period", "_word_since", "word")

    def __init__(self, period: float) -> None:
        """``period``: scan period in seconds."""
        self._period = period
        self.word: int | None = None
        self._mode: int | None = None
        self._word_since = self._mode_since = self._enabled_until = -math.inf

    def note(self, outputs: Outputs, now: float) -> None:
        """Record the outputs of this cycle; None leaves a value unchanged."""
        word, mode = outputs.controlword, outputs.mode
        if word is not None and word != self.word:
            if self._enables:
                self._enabled_until = now
            self.word, self._word_since = word, now
        if mode is not None and mode != self._mode:
            self._mode, self._mode_since = mode, now

    @property
    def _enables(self) -> bool:
        return self.word is not None and self.word & _ENABLE == _ENABLE

    def may_enable(self, now: float) -> bool:
        """Whether the last word is *enable operation*, or an earlier such word may still take effect before the last one does."""
        return self._enables or now < self._enabled_until + _ANSWERED * self._period

    def word_answered(self, now: float) -> bool:
        """Whether the state shown at ``now`` is the answer to the last controlword, and no earlier word can still take effect."""
        return now >= self._word_since + _ANSWERED * self._period

    def mode_answered(self, now: float) -> bool:
        """Whether the mode shown at ``now`` is the answer to the last requested mode."""
        return now >= self._mode_since + _MODE_TAKEN * self._period
