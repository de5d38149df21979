"""Compares the two position values of a module: by MIT control's ranges, and by the encoder's message, which has no ranges."""

from __future__ import annotations

import math

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.codec import decode
from axisbus.drives.gim6010.can_simple.decoded_message import DecodedMessage
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.can_simple.mit import MitFeedback
from axisbus.drives.gim6010.mit_control.settings import MitSettings

ESTIMATES = named("Get_Encoder_Estimates").command
_NEAR, _LATE = 0.05, 0.03  # tolerance in rad, and s of motion that are added to it
_TOGETHER = 0.015  # s at most between answer and estimate
_ENOUGH = 5  # disagreements in a row


class PositionCrossCheck:
    """Number of consecutive disagreements: wrong ranges or a wrong gear show as disagreements away from position 0.

    The encoder's message becomes invalid as soon as the module leaves closed loop, which its heartbeat shows only later. Therefore
    a heartbeat with closed loop must follow the first disagreement, and eight bytes of 0 are ignored.
    """

    def __init__(self, settings: MitSettings) -> None:
        self._settings = settings
        self._row = 0
        self._since = math.inf  # begin of the consecutive disagreements

    def take(self, frame: CanFrame, feedback: MitFeedback, feedback_at: float, closed_at: float) -> str:
        """Compare an estimate with the newest answer; return the reason to stop, or an empty text.

        ``feedback_at`` is the time of that answer, ``closed_at`` the time of the last heartbeat with closed loop (s). If answer and
        estimate are too far apart in time, they are not compared: the output turns meanwhile.
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
