"""An axis whose position is read from an input, as a ``cia402.port.Port``: an encoder, which others can follow."""

from __future__ import annotations

import math

from axisbus.cia301 import abort
from axisbus.cia301.nmt import NmtState
from axisbus.cia401.port import SignalValidity
from axisbus.cia402.port import (
    INPUT_OBJECTS,
    OUTPUT_OBJECTS,
    Capabilities,
    Inputs,
    Outputs,
    Sample,
    SdoReply,
    ValueTransport,
)
from axisbus.cia402.state import PowerState
from axisbus.core.io.io_scan import IoScan
from axisbus.core.virtual.stage import STATUSWORDS
from axisbus.units import wrap

_OPERATIONAL = int(NmtState.OPERATIONAL)
_OFF = STATUSWORDS[PowerState.SWITCH_ON_DISABLED]
_AGE = 0.1  # seconds, of the statusword, which is of the present cycle


class EncoderPort:
    """Holds the unwrapped count: the input wraps at the end of its width, and the count does not.

    The input decides whether a count is fresh. If its value is unknown, the axis has no position.
    """

    def __init__(self, board: IoScan, name: str) -> None:
        """``name`` of the input, which is on this board when its node has come up."""
        self._board = board
        self._name = name
        self._replies: tuple[SdoReply, ...] = ()
        self._count: int | None = None
        inputs = dict.fromkeys(INPUT_OBJECTS, ValueTransport.NONE) | {
            "statusword": ValueTransport.SYNC_PDO,
            "position": board.source_of(name),
        }
        outputs = dict.fromkeys(OUTPUT_OBJECTS, ValueTransport.NONE)
        ages = dict.fromkeys(inputs, _AGE) | {"position": math.inf}
        self.capabilities = Capabilities(inputs, outputs, remappable=False, max_age=ages)

    def read(self, now: float) -> Inputs:
        """Return the position of the newest count."""
        replies, self._replies = self._replies, ()
        return Inputs(
            now,
            operational=True,
            statusword=Sample(_OFF, now),
            mode=None,
            position=self._position(),
            velocity=None,
            torque=None,
            demand=None,
            sdo=replies,
            nmt=_OPERATIONAL,
        )

    def write(self, outputs: Outputs) -> None:
        """Answer that there are no objects to write or read."""
        self._replies = tuple(SdoReply(each.id, None, abort.OBJECT_MISSING) for each in outputs.sdo or ())

    def _position(self) -> Sample | None:
        reading = self._board.readings.get(self._name)
        if reading is None or reading.known is not SignalValidity.YES or reading.value is None:
            return None
        if self._count is None:
            self._count = reading.value
        half = 1 << self._board.width_of(self._name) - 1
        self._count += (reading.value - self._count + half) % (2 * half) - half
        return Sample(wrap(self._count), reading.stamp)
