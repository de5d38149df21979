"""A calibration from the first look to its end, as a dialogue with one module; pure: frames and times in, requests out.

Theory of operation
-------------------
The request to calibrate goes out once: repeated, it would begin anew. The heartbeat then shows sub-states (4, 7 and others, never
the 3 that was asked for), and idle at the end; the encoder's count, asked for all the time, shows how far the rotor turns. Then
the error words are asked for, and judged with all of it.

Silence, a restart, a state that is none of a calibration's, too many turns, and too long a time end it (``leading.led``).
"""

from __future__ import annotations

from enum import Enum

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.calibration import result
from axisbus.drives.gim6010.calibration.kinds import ON_THE_WAY, CalibrationKind
from axisbus.drives.gim6010.calibration.result import CalibrationResult
from axisbus.drives.gim6010.calibration.rotation import RotorRotation
from axisbus.drives.gim6010.can_simple import error_query
from axisbus.drives.gim6010.can_simple.codec import Outgoing, decode, encode, request
from axisbus.drives.gim6010.can_simple.decoded_message import DecodedMessage
from axisbus.drives.gim6010.can_simple.error_query import ErrorType
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.can_simple.states import IDLE, state_words
from axisbus.drives.gim6010.direct_motion.heartbeat_monitor import PERIODS
from axisbus.drives.gim6010.direct_motion.motion_procedure import ModuleMotionProcedure, ModuleMotionStage

_STATE, _COUNT = named("Set_Axis_State"), named("Get_Encoder_Count")
BEGINS = 2.0  # s in which the heartbeat has to show it
LONGEST = 300.0  # s: after five minutes the manual has it cancelled
_COUNTS = 0.03  # s between two questions for the count
_WORD, _TRIES = 0.15, 2  # s for an answer


class CalibrationPhase(Enum):
    """How far the module is with it."""

    BEGINNING = "asked for"
    RUNNING = "under way"
    READING = "reading its errors"


class Calibration(ModuleMotionProcedure):
    """One calibration; holds what was heard. ``verdict`` is None where it did not come to its own end: ``why`` then says why."""

    def __init__(self, node: int, kind: CalibrationKind, *, remote: bool = True) -> None:
        """``node`` 0 to 63; ``remote``: whether the bus carries remote frames.

        Raises:
            ArgumentError: the node is none.
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

    # What is heard.

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
        """Take the state of a heartbeat that came after the request."""
        last = self._pulse.last
        if self._phase is CalibrationPhase.READING or last is None:
            return
        if last.state != IDLE and last.state not in ON_THE_WAY:
            self._end(f"the module is in {state_words(last.state)}, which is none of a calibration's")
        elif last.state != IDLE:
            self._phase = CalibrationPhase.RUNNING
            if last.state not in self._seen[-1:]:
                self._seen.append(last.state)
                self.news.append(f"{state_words(last.state)}, {time - self._begun:.1f} s")
        elif self._phase is CalibrationPhase.RUNNING or last.axis_error:
            self._phase = CalibrationPhase.READING

    # What is sent.

    def _begin(self) -> Outgoing:
        self.news.append(f"{self.kind.words} is asked for")
        return encode(self.node, _STATE, {"Axis_Requested_State": self.kind.value})

    def _lead(self, now: float) -> Outgoing | None:
        lost = self._pulse.lost(now)
        if lost:  # one that restarts shows idle, too
            self._end(lost)
            return None
        return self._read(now) if self._phase is CalibrationPhase.READING else self._run(now)

    def _run(self, now: float) -> Outgoing | None:
        waits = self._phase is CalibrationPhase.BEGINNING
        if waits and now - self._begun > max(BEGINS, PERIODS * self._pulse.period):
            self._end("the module does not begin: its heartbeat goes on to show idle")
        elif self.turned.farthest > self.kind.farthest:
            turns = f"{self.turned.farthest:.1f} rotor turns"
            self._end(f"the rotor has turned by {turns}, farther than a calibration may")
        elif now - self._begun > LONGEST:
            self._end(f"it has not come to its end in {LONGEST:g} s")
        elif not now - self._asked < _COUNTS:
            self._asked = now
            return request(self.node, _COUNT, remote=self._remote)
        return None

    def _read(self, now: float) -> Outgoing | None:
        last = self._pulse.last
        if last is None or last.state != IDLE:
            self._end("the module does not stay idle: somebody else commands it")
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
