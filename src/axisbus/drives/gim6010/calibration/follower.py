"""A calibration from the first look to its end, as a dialogue with one module; pure: frames and times in, requests out.

Theory of operation
-------------------
It listens first, and begins only where one module beats under this node ID, idle and without a fault. The request to calibrate goes
out once: repeated, it would begin anew. The heartbeat then shows sub-states (4, 7 and others, never the 3 that was asked for), and
idle at the end; the encoder's count, asked for all the time, shows how far the rotor turns. Then the error words are asked for, and
judged with all of it.

Whatever else happens, an interrupt, silence, a restart, a state that is none of a calibration's, too many turns, or too long a
time, ends it: idle is sent until the heartbeat shows it, then ESTOP, and the outcome says how the module was left.
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
from axisbus.drives.gim6010.can_simple.identifier import split
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.can_simple.reading import Reading
from axisbus.drives.gim6010.can_simple.states import IDLE, state_words
from axisbus.drives.gim6010.leading.letting_go import LettingGo, idle
from axisbus.drives.gim6010.leading.pulse import PERIODS, Pulse

_STATE, _COUNT = named("Set_Axis_State"), named("Get_Encoder_Count")
LISTEN = 1.5  # s before it begins
BEGINS = 2.0  # s in which the heartbeat has to show it
LONGEST = 300.0  # s: after five minutes the manual has it cancelled
_COUNTS = 0.03  # s between two questions for the count
_WORD, _TRIES = 0.15, 2  # s for an answer


class Phase(Enum):
    """How far it is."""

    LISTENING = "listening"
    BEGINNING = "asked for"
    RUNNING = "under way"
    READING = "reading its errors"
    ENDING = "being ended"
    DONE = "over"


class Calibration:
    """One calibration; holds what was heard. ``news`` are lines for people, ``verdict`` is None where it did not end by itself.

    ``why`` then says why; ``left`` how the module stands, and ``confirmed`` whether there is surely no power on its motor.
    """

    def __init__(self, node: int, kind: Kind, *, remote: bool = True) -> None:
        """``node`` 0 to 63; ``remote``: whether the bus carries remote frames.

        Raises:
            ArgumentError: the node is none.
        """
        self.node, self.kind = node, kind
        self.phase = Phase.LISTENING
        self.news: deque[str] = deque()
        self.verdict: Verdict | None = None
        self.why = self.left = ""
        self.confirmed = True
        self.turned = Turning()
        self._remote = remote
        self._pulse = Pulse(node)
        self._letting_go = LettingGo(self._pulse)
        self._seen: list[int] = []
        self._words: dict[str, int] = {}
        self._to_read: list[ErrorType] = list(ErrorType)
        self._tried = 0
        self._start: float | None = None
        self._begun = 0.0  # when it was asked for
        self._asked = float("-inf")
        self._wishes: deque[str] = deque()

    # What a dialogue is asked.

    @property
    def done(self) -> bool:
        """Whether it is over."""
        return self.phase is Phase.DONE

    @property
    def parting(self) -> tuple[Outgoing, ...]:
        """What takes the power away, for whoever cannot go on with it."""
        return (idle(self.node),)

    def note(self, frame: Frame) -> None:
        """Take a frame that was heard."""
        if self._pulse.take(frame):
            if self.phase in (Phase.BEGINNING, Phase.RUNNING) and frame.time > self._begun:
                self._follow(frame.time)
        elif not (frame.extended or frame.remote) and split(frame.can_id).node == self.node:
            self._hear(split(frame.can_id).command, frame)

    def trouble(self, words: str) -> None:
        """Hear that a request was not acknowledged, or not sent."""
        self._end(f"the bus: {words}")

    def interrupt(self, why: str) -> None:
        """Have it ended with the next step, from any thread or signal handler; a second time goes on to ESTOP at once."""
        self._wishes.append(why)

    def step(self, now: float) -> Outgoing | None:
        """Let time pass, and return what is to be sent now."""
        while self._wishes:
            self._heed(self._wishes.popleft())
        self._start = now if self._start is None else self._start
        act = _STEPS.get(self.phase)
        return None if act is None else act(self, now)

    # What is heard.

    def _hear(self, command: int, frame: Frame) -> None:
        if command == _COUNT.command and self.phase is not Phase.LISTENING:
            found = decode(frame.can_id, frame.data, from_module=True)
            if isinstance(found, Reading):
                self.turned.take(int(found.values["Count_In_Cpr"]))
        elif command == error_query.GET_ERROR.command and self.phase is Phase.READING and self._tried:
            word = error_query.read(self.node, frame.data, self._to_read[0])
            if isinstance(word, int):
                self._words[self._to_read.pop(0).category] = word
                self._tried = 0

    def _follow(self, time: float) -> None:
        """Take the state of a heartbeat that came after the request."""
        last = self._pulse.last
        assert last is not None  # one has just come
        if last.state != IDLE and last.state not in ON_THE_WAY:
            self._end(f"the module is in {state_words(last.state)}, which is none of a calibration's")
        elif last.state != IDLE:
            self.phase = Phase.RUNNING
            if last.state not in self._seen[-1:]:
                self._seen.append(last.state)
                self.news.append(f"{state_words(last.state)}, {time - self._begun:.1f} s")
        elif self.phase is Phase.RUNNING or last.axis_error:
            self.phase = Phase.READING

    # Phases.

    def _listen(self, now: float) -> Outgoing | None:
        assert self._start is not None  # ``step`` has set it
        if now - self._start < LISTEN:
            return None
        self._pulse.settle()
        against = self._pulse.against(now)
        if against:
            self._end(against)
            return None
        self.phase, self._begun = Phase.BEGINNING, now
        self.news.append(f"{self.kind.words} is asked for")
        return encode(self.node, _STATE, {"Axis_Requested_State": self.kind.value})

    def _begin(self, now: float) -> Outgoing | None:
        if now - self._begun > max(BEGINS, PERIODS * self._pulse.period):
            self._end("the module does not begin: its heartbeat goes on to show idle")
            return None
        return self._run(now)

    def _run(self, now: float) -> Outgoing | None:
        lost = self._pulse.lost(now)
        if lost:
            self._end(lost)
        elif self.turned.farthest > self.kind.farthest:
            self._end(
                f"the rotor has turned by {self.turned.farthest:.1f} rotor turns, farther than a calibration may"
            )
        elif now - self._begun > LONGEST:
            self._end(f"it has not come to its end in {LONGEST:g} s")
        elif not now - self._asked < _COUNTS:
            self._asked = now
            return request(self.node, _COUNT, remote=self._remote)
        return None

    def _read(self, now: float) -> Outgoing | None:
        last, lost = self._pulse.last, self._pulse.lost(now)
        if lost:  # one that restarts shows idle, too
            self._end(lost)
        elif last is None or last.state != IDLE:
            self._end("the module does not stay idle: somebody else commands it")
        elif not self._to_read:
            self.verdict = verdict.judge(self.kind, self._seen, last, self._words, self.turned)
            self.left, self.phase = f"module {self.node} is idle by its heartbeat", Phase.DONE
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

    # The end that is made.

    def _heed(self, why: str) -> None:
        if self.phase is Phase.ENDING:
            self._letting_go.escalate()
        else:
            self._end(why)

    def _end(self, why: str) -> None:
        """End it for this reason; where nothing was asked for there is nothing to end."""
        if self.phase is Phase.DONE:
            return
        self.why = self.why or why
        if self.phase is Phase.LISTENING:
            self.left, self.phase = "nothing was sent that moves it", Phase.DONE
        else:
            self.phase = Phase.ENDING

    def _let_go(self, now: float) -> Outgoing | None:
        frame = self._letting_go.step(now)
        if self._letting_go.over:
            self.left, self.confirmed = self._letting_go.left, self._letting_go.confirmed
            self.phase = Phase.DONE
        return frame


_STEPS = {
    Phase.LISTENING: Calibration._listen,
    Phase.BEGINNING: Calibration._begin,
    Phase.RUNNING: Calibration._run,
    Phase.READING: Calibration._read,
    Phase.ENDING: Calibration._let_go,
}
