"""What a drive was sent so recently that what it shows may not be an answer to it yet."""

from __future__ import annotations

import math

from axisbus.cia402.controlword import PowerCommand
from axisbus.cia402.port import Outputs

# Scan periods: the SYNC that brings it into effect, the one at which the answer is sampled, and the cycle that reads it; half a one
# less, because times do not add up exactly.
_ANSWERED = 2.5
_ENABLE = PowerCommand.ENABLE_OPERATION.word
_MODE_TAKEN = 3.5  # a drive looks at 6060h in a slower task


class PendingOutputs:
    """Holds the last controlword (``word``) and mode that were sent, and since when; times in seconds of the scan's clock."""

    __slots__ = ("_enabled_until", "_mode", "_mode_since", "_period", "_word_since", "word")

    def __init__(self, period: float) -> None:
        """``period``: of the scan, in seconds."""
        self._period = period
        self.word: int | None = None
        self._mode: int | None = None
        self._word_since = self._mode_since = self._enabled_until = -math.inf

    def note(self, outputs: Outputs, now: float) -> None:
        """Take what goes out in this cycle; None goes on as it was."""
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
        """Whether a word *enable operation* is the last one, or may not have taken effect yet although another has followed it."""
        return self._enables or now < self._enabled_until + _ANSWERED * self._period

    def word_answered(self, now: float) -> bool:
        """Whether the state that is shown at ``now`` follows the controlword, and none before it is still on its way."""
        return now >= self._word_since + _ANSWERED * self._period

    def mode_answered(self, now: float) -> bool:
        """Whether the mode that is shown at ``now`` follows the one that was asked for last."""
        return now >= self._mode_since + _MODE_TAKEN * self._period
