"""A calibration of one module, from the first heartbeat to its end; pure: frames and times in, requests out.

Theory of operation
-------------------
The calibration is requested once: a repeated request would restart it. The heartbeat then shows sub-states (4, 7 and others, never
the requested 3), and idle at the end. The encoder's count, requested periodically, shows the rotation of the rotor. At the end the
error words are requested, and the result is judged by all of these.

Silence, a restart, a state that does not belong to a calibration, too many turns, and a time-out end the procedure
(``ModuleMotionProcedure``).
"""

from __future__ import annotations

from enum import Enum

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.calibration import result
from axisbus.drives.gim6010.calibration.kinds import ON_THE_WAY, CalibrationKind
from axisbus.drives.gim6010.calibration.result import CalibrationResult, RotorRotation
from axisbus.drives.gim6010.can_simple import error_query
from axisbus.drives.gim6010.can_simple.codec import DecodedMessage, Outgoing, decode, encode, request
from axisbus.drives.gim6010.can_simple.error_query import ErrorType
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.can_simple.states import IDLE, state_words
from axisbus.drives.gim6010.direct_motion import PERIODS, ModuleMotionProcedure, ModuleMotionStage

_STATE, _COUNT = named("Set_Axis_State"), named("Get_Encoder_Count")
BEGINS = 2.0  # s until the heartbeat must show the calibration
LONGEST = 300.0  # s: the manual says to cancel it after five minutes
_COUNTS = 0.03  # s between two requests for the count
_WORD, _TRIES = 0.15, 2  # s to wait for an error word, and requests for it


class CalibrationPhase(Enum):
    """Phase of the calibration."""

    BEGINNING = "asked for"
    RUNNING = "under way"
    READING = "reading its errors"


class Calibration(ModuleMotionProcedure):
    """One calibration and its observations. ``verdict`` is None if it was aborted; ``why`` is then the reason."""

    def __init__(self, node: int, kind: CalibrationKind, *, remote: bool = True) -> None:
        """``node`` 0 to 63; ``remote``: whether the bus carries remote frames.

        Raises:
            ArgumentError: the node ID is invalid.
        """
        super().__init__(node)
        self.kind = kind
        self.verdict: CalibrationResult | None = None
        self.turned = RotorRotation()
        self._remote = remote
        self._phase = CalibrationPhase.BEGINNING
        self._seen: list[int] = []
        self._words: dict[str, int] = {}
        self._to_read: list[ErrorType] = list(ErrorType)
        self._tried = 0
        self._asked = float("-inf")

    # Reception.

    def _hear(self, command: int, frame: CanFrame) -> None:
        if self.stage is not ModuleMotionStage.LED:
            return
        if command == _COUNT.command:
            found = decode(frame.can_id, frame.data, from_module=True)
            if isinstance(found, DecodedMessage):
                self.turned.take(int(found.values["Count_In_Cpr"]))
        elif (
            command == error_query.GET_ERROR.command
            and self._phase is CalibrationPhase.READING
            and self._tried
        ):
            word = error_query.read(self.node, frame.data, self._to_read[0])
            if isinstance(word, int):
                self._words[self._to_read.pop(0).category] = word
                self._tried = 0

    def _follow(self, time: float) -> None:
        """Take the state of a heartbeat received after the request."""
        last = self._pulse.last
        if self._phase is CalibrationPhase.READING or last is None:
            return
        if last.state != IDLE and last.state not in ON_THE_WAY:
            self._end(f"the module is in {state_words(last.state)}, which does not belong to a calibration")
        elif last.state != IDLE:
            self._phase = CalibrationPhase.RUNNING
            if last.state not in self._seen[-1:]:
                self._seen.append(last.state)
                self.news.append(f"{state_words(last.state)}, {time - self._begun:.1f} s")
        elif self._phase is CalibrationPhase.RUNNING or last.axis_error:
            self._phase = CalibrationPhase.READING

    # Sending.

    def _begin(self) -> Outgoing:
        self.news.append(f"{self.kind.words} is asked for")
        return encode(self.node, _STATE, {"Axis_Requested_State": self.kind.value})

    def _lead(self, now: float) -> Outgoing | None:
        lost = self._pulse.lost(now)
        if lost:  # checked first: a restarted module shows idle, too
            self._end(lost)
            return None
        return self._read(now) if self._phase is CalibrationPhase.READING else self._run(now)

    def _run(self, now: float) -> Outgoing | None:
        waits = self._phase is CalibrationPhase.BEGINNING
        if waits and now - self._begun > max(BEGINS, PERIODS * self._pulse.period):
            self._end("the module does not begin: its heartbeat still shows idle")
        elif self.turned.farthest > self.kind.farthest:
            turns = f"{self.turned.farthest:.1f} rotor turns"
            self._end(f"the rotor has turned by {turns}, farther than a calibration may turn it")
        elif now - self._begun > LONGEST:
            self._end(f"it has not ended within {LONGEST:g} s")
        elif not now - self._asked < _COUNTS:
            self._asked = now
            return request(self.node, _COUNT, remote=self._remote)
        return None

    def _read(self, now: float) -> Outgoing | None:
        last = self._pulse.last
        if last is None or last.state != IDLE:
            self._end("the module does not stay idle: another program commands it")
        elif not self._to_read:
            errors = result.errors(last, self._words)
            self.verdict = result.judge(
                self.kind, self._seen, errors, self.turned, words_told=bool(self._words)
            )
            self.left, self.stage = f"module {self.node} is idle by its heartbeat", ModuleMotionStage.DONE
        elif not now - self._asked < _WORD:
            return self._ask_word(now)
        return None

    def _ask_word(self, now: float) -> Outgoing | None:
        if self._tried >= _TRIES:
            self._to_read.pop(0)
            self._tried = 0
            return None
        self._asked, self._tried = now, self._tried + 1
        return error_query.request(self.node, self._to_read[0])
