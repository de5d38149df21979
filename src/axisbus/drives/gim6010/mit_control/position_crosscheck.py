"""Whether a module's two ways to tell its position agree: by MIT control's ranges, and by the encoder's message without any."""

from __future__ import annotations

import math

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.codec import decode
from axisbus.drives.gim6010.can_simple.decoded_message import DecodedMessage
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.can_simple.mit import MitFeedback
from axisbus.drives.gim6010.mit_control.settings import MitSettings

ESTIMATES = named("Get_Encoder_Estimates").command
_NEAR, _LATE = 0.05, 0.03  # rad, and s by which one may be older than the other
_TOGETHER = 0.015  # s
_ENOUGH = 5  # disagreements in a row


class PositionCrossCheck:
    """Holds how often they disagreed in a row: ranges or a gear that are not the module's own show by it, away from 0.

    The message is dead as soon as the module leaves closed loop, which its heartbeat tells later: so one that shows closed loop has
    to come after the first disagreement, and eight bytes of 0 say nothing.
    """

    def __init__(self, settings: MitSettings) -> None:
        self._settings = settings
        self._row = 0
        self._since = math.inf  # of the row

    def take(self, frame: CanFrame, feedback: MitFeedback, feedback_at: float, closed_at: float) -> str:
        """Take an estimate beside the newest answer; return why it is not to be gone on, or nothing.

        ``feedback_at`` is when that came, ``closed_at`` when a heartbeat showed closed loop last (s). Where the two came too far
        apart in time they are not compared: the output turns meanwhile.
        """
        found = decode(frame.can_id, frame.data, from_module=True)
        if (
            not isinstance(found, DecodedMessage)
            or not any(frame.data)
            or frame.time - feedback_at > _TOGETHER
        ):
            return ""
        turns = found.values["Pos_Estimate"]
        position = float(turns) * math.tau / self._settings.gear
        apart = abs(position - feedback.position)
        speed = max(
            abs(feedback.velocity), abs(float(found.values["Vel_Estimate"]) * math.tau / self._settings.gear)
        )
        agrees = apart <= _NEAR + _LATE * speed
        self._row = 0 if agrees else self._row + 1
        self._since = frame.time if self._row == 1 else self._since
        if self._row < _ENOUGH or closed_at <= self._since:
            return ""
        return (
            f"its position is {feedback.position:.3f} rad by MIT control and {position:.3f} rad by its encoder's message: "
            "the ranges or the gear that were given are not the module's"
        )
