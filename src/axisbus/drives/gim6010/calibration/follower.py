"""A calibration from the first look to its end, as a dialogue with one module; pure: frames and times in, requests out.

Theory of operation
-------------------
It listens first, and begins only where one module beats under this node ID, idle and without a fault. The request to calibrate goes
out once: repeated, it would begin anew. The heartbeat then shows sub-states (4, 7 and others, never the 3 that was asked for), and
idle at the end; the encoder's count, asked for all the time, shows how far the rotor turns. Then the error words are asked for, and
judged with all of it.

Whatever else happens, an interrupt, an error, silence, a restart, a state that is none of a calibration's, too many turns, or too
long a time, ends it: idle is sent until the heartbeat shows it, then ESTOP, and the outcome says how the module was left.
"""

from __future__ import annotations

from collections import deque
from enum import Enum

from axisbus.cia301.frame import Frame
from axisbus.drives.gim6010.calibration import verdict
from axisbus.drives.gim6010.calibration.kinds import ON_THE_WAY, Kind
from axisbus.drives.gim6010.calibration.turning import Turning
from axisbus.drives.gim6010.calibration.verdict import Verdict
from axisbus.drives.gim6010.can_simple import error_query
from axisbus.drives.gim6010.can_simple.codec import Outgoing, decode, encode, request
from axisbus.drives.gim6010.can_simple.error_query import ErrorType
from axisbus.drives.gim6010.can_simple.heartbeat import Heartbeat, Heartbeats
from axisbus.drives.gim6010.can_simple.identifier import NODES, split
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.can_simple.reading import Reading
from axisbus.drives.gim6010.can_simple.states import IDLE, state_words
from axisbus.drives.gim6010.finding.doubles import voices
from axisbus.errors import ArgumentError

_STATE, _ESTOP, _COUNT = (named(each) for each in ("Set_Axis_State", "Estop", "Get_Encoder_Count"))
_BEAT = named("Heartbeat").command
LISTEN = 1.5  # s before it begins
BEGINS = 2.0  # s in which the heartbeat has to show it
LONGEST = 300.0  # s: after five minutes the manual has it cancelled
_SILENCE, _PERIODS = 0.6, 5  # s, or periods of its heartbeat, after which a module is lost
_COUNTS = 0.03  # s between two questions for the count
_WORD, _TRIES = 0.15, 2  # s for an answer
_AGAIN = 0.05  # s between two frames that end it
RUNG = 1.5  # s for idle, then for ESTOP, to be seen


class Phase(Enum):
    """How far it is."""

    LISTENING = "listening"
    BEGINNING = "asked for"
    RUNNING = "under way"
    READING = "reading its errors"
    ENDING = "being ended"
    DONE = "over"


class Calibration:
    """One calibration; holds what was heard. ``news`` are lines for people, ``verdict`` is None where it did not end by itself."""

    def __init__(self, node: int, kind: Kind, *, remote: bool = True) -> None:
        """``node`` 0 to 63; ``remote``: whether the bus carries remote frames.

        Raises:
            ArgumentError: the node is none.
        """
        if node not in NODES:
            raise ArgumentError(f"{node!r} is no node ID of CAN Simple", remedy="give a number from 0 to 63")
        self.node, self.kind = node, kind
        self.phase = Phase.LISTENING
        self.news: deque[str] = deque()
        self.verdict: Verdict | None = None
        self.why = ""  # it did not end by itself, or did not begin
        self.left = ""  # how the module stands
        self.confirmed = True  # that there is no power on its motor
        self.turned = Turning()
        self._remote = remote
        self._beats = Heartbeats()
        self._stamps: deque[tuple[float, bytes]] = deque(maxlen=32)
        self._restarts = 0
        self._seen: list[int] = []
        self._words: dict[str, int] = {}
        self._left: list[ErrorType] = list(ErrorType)
        self._tried = 0
        self._start: float | None = None  # of the phase
        self._first = 0.0  # when it was asked for, or its end was
        self._sent = self._asked = float("-inf")
        self._estop = False
        self._pleas = 0  # frames that were sent to end it
        self._alone = True
        self._wishes: deque[str] = deque()

    # What a dialogue is asked.

    @property
    def done(self) -> bool:
        """Whether it is over."""
        return self.phase is Phase.DONE

    @property
    def parting(self) -> tuple[Outgoing, ...]:
        """What takes the power away, for whoever cannot go on with it."""
        return (encode(self.node, _STATE, {"Axis_Requested_State": IDLE}),)

    def note(self, frame: Frame) -> None:
        """Take a frame that was heard."""
        if frame.extended or frame.remote or split(frame.can_id).node != self.node:
            return
        command = split(frame.can_id).command
        if command == _BEAT:
            self._beat(frame)
        elif command == _COUNT.command:
            self._count(frame)
        elif command == error_query.GET_ERROR.command:
            self._word(frame)

    def trouble(self, words: str) -> None:
        """Hear that a request was not acknowledged, or not sent."""
        if self.phase is not Phase.ENDING:
            self._end(f"the bus: {words}")

    def interrupt(self, why: str) -> None:
        """Have it ended with the next step, from any thread or signal handler; a second time goes on to ESTOP at once."""
        self._wishes.append(why)

    def step(self, now: float) -> Outgoing | None:
        """Let time pass, and return what is to be sent now."""
        while self._wishes:
            self._heed(self._wishes.popleft())
        if self._start is None:
            self._start = now
        act = _STEPS.get(self.phase)
        return None if act is None else act(self, now)

    def _heed(self, why: str) -> None:
        if self.phase is not Phase.ENDING:
            self._end(why)
        elif not self._estop:
            self._estop, self._start, self._pleas = True, None, 0

    # What is heard.

    @property
    def _last(self) -> Heartbeat | None:
        return self._beats.last

    @property
    def _beat_at(self) -> float:
        return self._stamps[-1][0] if self._stamps else float("-inf")

    def _beat(self, frame: Frame) -> None:
        seen = self._beats.after(self.node, frame.data)
        if not isinstance(seen, Heartbeats):
            return
        self._beats = seen
        self._stamps.append((frame.time, bytes(frame.data)))
        self._alone = voices(list(self._stamps)) == 1
        if self.phase in (Phase.BEGINNING, Phase.RUNNING) and frame.time > self._first:
            self._follow(frame.time)

    def _count(self, frame: Frame) -> None:
        found = decode(frame.can_id, frame.data, from_module=True)
        if isinstance(found, Reading) and self.phase is not Phase.LISTENING:
            self.turned.take(int(found.values["Count_In_Cpr"]))

    def _word(self, frame: Frame) -> None:
        if self.phase is Phase.READING and self._left and self._tried:
            word = error_query.read(self.node, frame.data, self._left[0])
            if isinstance(word, int):
                self._words[self._left.pop(0).category] = word
                self._tried = 0

    # Phases.

    def _listen(self, now: float) -> Outgoing | None:
        assert self._start is not None
        if now - self._start < LISTEN:
            return None
        self._restarts = self._beats.restarts
        against = self._against(now)
        if against:
            self._end(against)
            return None
        self._enter(Phase.BEGINNING, now)
        self._first = now
        self.news.append(f"{self.kind.words} is asked for")
        return encode(self.node, _STATE, {"Axis_Requested_State": self.kind.value})

    def _against(self, now: float) -> str:
        """Why it is not begun; empty where nothing stands against it."""
        last = self._last
        if last is None or self._is_silent(now):
            return f"module {self.node} sends no heartbeat, by which alone a calibration can be followed"
        if not self._alone:
            return f"several modules have the node ID {self.node}: all of them would turn"
        if last.state != IDLE:
            return (
                f"module {self.node} is in {state_words(last.state)}, and only one that is idle is calibrated"
            )
        found = verdict.errors(last, {})
        return (
            f"module {self.node} has errors, with which it does not begin: {'; '.join(found)}"
            if found
            else ""
        )

    def _begin(self, now: float) -> Outgoing | None:
        if now - self._first > max(BEGINS, _PERIODS * self._period):
            self._end("the module does not begin: its heartbeat goes on to show idle")
            return None
        return self._run(now)

    def _run(self, now: float) -> Outgoing | None:
        if self._is_silent(now):
            self._end("the module is no longer heard")
        elif self._beats.restarts > self._restarts:
            self._end("the module restarted meanwhile")
        elif not self._alone:
            self._end("a second module of this node ID is heard")
        elif self.turned.farthest > self.kind.farthest:
            self._end(
                f"the rotor has turned by {self.turned.farthest:.1f} rotor turns, farther than a calibration may"
            )
        elif now - self._first > LONGEST:
            self._end(f"it has not come to its end in {LONGEST:g} s")
        else:
            return self._ask_count(now)
        return None

    def _follow(self, time: float) -> None:
        """Take the state of a heartbeat that came after the request."""
        last = self._last
        assert last is not None
        if last.state != IDLE and last.state not in ON_THE_WAY:
            self._end(f"the module is in {state_words(last.state)}, which is none of a calibration's")
        elif last.state != IDLE:
            self.phase = Phase.RUNNING
            if last.state not in self._seen[-1:]:
                self._seen.append(last.state)
                self.news.append(f"{state_words(last.state)}, {time - self._first:.1f} s")
        elif self.phase is Phase.RUNNING or last.axis_error:
            self._enter(Phase.READING, time)

    def _read(self, now: float) -> Outgoing | None:
        if self._last is None or self._last.state != IDLE:
            self._end("the module does not stay idle: somebody else commands it")
            return None
        if not self._left:
            self._finish()
            return None
        if now - self._asked < _WORD:
            return None
        if self._tried >= _TRIES:
            self._left.pop(0)
            self._tried = 0
            return None
        self._asked, self._tried = now, self._tried + 1
        return error_query.request(self.node, self._left[0])

    def _finish(self) -> None:
        assert self._last is not None  # it has been seen to be idle
        self.verdict = verdict.judge(self.kind, self._seen, self._last, self._words, self.turned)
        self.left = f"module {self.node} is idle by its heartbeat"
        self.phase = Phase.DONE

    # The end that is made.

    def _end(self, why: str) -> None:
        """End it for this reason; where nothing was asked for there is nothing to end."""
        if self.phase is Phase.DONE:
            return
        self.why = self.why or why
        if self.phase is Phase.LISTENING:
            self.left, self.phase = "nothing was sent that moves it", Phase.DONE
        else:
            self.phase, self._start, self._pleas = Phase.ENDING, None, 0

    def _let_go(self, now: float) -> Outgoing | None:
        assert self._start is not None
        shown = self._last is not None and self._last.state == IDLE and self._beat_at > self._start + _AGAIN
        if shown and self._pleas > 1:
            after = "ESTOP, whose error latches until it is cleared" if self._estop else "idle was sent"
            self.left, self.phase = f"module {self.node} is idle by its heartbeat, after {after}", Phase.DONE
            return None
        if now - self._start > RUNG + self._patience:
            self._over_late(now)
            return None
        if now - self._sent < _AGAIN:
            return None
        self._sent, self._pleas = now, self._pleas + 1
        return encode(self.node, _ESTOP) if self._estop else self.parting[0]

    def _over_late(self, now: float) -> None:
        if not self._estop:
            self._estop, self._start, self._pleas = True, now, 0
            return
        self.confirmed = False
        heard = "is not heard" if self._is_silent(now) else "is heard, and does not show idle"
        self.left = f"NOT CONFIRMED: module {self.node} {heard} after idle and ESTOP; switch its supply off"
        self.phase = Phase.DONE

    # Helpers.

    def _enter(self, phase: Phase, now: float) -> None:
        self.phase, self._start = phase, now

    def _ask_count(self, now: float) -> Outgoing | None:
        if now - self._asked < _COUNTS:
            return None
        self._asked = now
        return request(self.node, _COUNT, remote=self._remote)

    @property
    def _period(self) -> float:
        """Of its heartbeat, as far as it is known."""
        if len(self._stamps) < 2:
            return 0.0
        return (self._stamps[-1][0] - self._stamps[0][0]) / (len(self._stamps) - 1)

    @property
    def _patience(self) -> float:
        return 2.0 * self._period

    def _is_silent(self, now: float) -> bool:
        return now - self._beat_at > max(_SILENCE, _PERIODS * self._period)


_STEPS = {
    Phase.LISTENING: Calibration._listen,
    Phase.BEGINNING: Calibration._begin,
    Phase.RUNNING: Calibration._run,
    Phase.READING: Calibration._read,
    Phase.ENDING: Calibration._let_go,
}
