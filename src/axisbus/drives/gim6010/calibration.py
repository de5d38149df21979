"""Calibration of a module: its kinds and their motion, its result, and its procedure over CAN Simple or a relay; pure.

Theory of operation
-------------------
The calibration is requested once: a repeated request would restart it. The heartbeat then shows sub-states (4, 7 and others, never
the requested 3), and idle at the end. The encoder's count, requested periodically, shows the rotation of the rotor. At the end the
error words are requested, and the result is judged by all of these.

On RS485 the relay (``modbus.can_emulation``) reads the registers, and presents heartbeat, count and error words as these messages.

Silence, a restart, a state that does not belong to a calibration, too many turns, and a time-out end the procedure
(``ModuleMotionProcedure``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple import error_query
from axisbus.drives.gim6010.can_simple.codec import DecodedMessage, Outgoing, decode, encode, request
from axisbus.drives.gim6010.can_simple.error_query import ErrorType
from axisbus.drives.gim6010.can_simple.heartbeat import PERIODS, reported_errors
from axisbus.drives.gim6010.can_simple.messages import IDLE, named, state_words
from axisbus.drives.gim6010.direct_motion import ModuleMotionProcedure, ModuleMotionStage
from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN
from axisbus.drives.gim6010.make import GEAR_RATIO

# -- The calibrations, and the motion that each causes, as text for the operator (manual v2.2, 3.1.4) ------------------


_MOTOR_STATE, _ENCODER_STATE = 4, 7


class CalibrationKind(Enum):
    """A calibration by the state that starts it; ``parts`` are the states that must be seen, since 3 is never reported."""

    MOTOR = 4
    ENCODER = 7
    FULL = 3

    @property
    def words(self) -> str:
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


def strange(state: int) -> str:
    """Return the reason to abort a calibration in this state; empty if the state may appear in one."""
    known = state == IDLE or state in ON_THE_WAY
    return "" if known else f"the module is in {state_words(state)}, which does not belong to a calibration"


def too_far(kind: CalibrationKind, turned: RotorRotation) -> str:
    """Return the reason to abort a calibration whose rotor has turned too far; empty if it has not."""
    if turned.farthest <= kind.farthest:
        return ""
    return (
        f"the rotor has turned by {turned.farthest:.1f} rotor turns, farther than a calibration may turn it"
    )


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


# -- The result, judged by the states, the error words, and the motion of the rotor ------------------------------------


_TURNS = 0.02  # rotor turns from which the encoder's calibration counts as having turned
_DEGREES = 360.0 / GEAR_RATIO


@dataclass(frozen=True, slots=True)
class CalibrationResult:
    """Whether the calibration succeeded; ``wrong`` are the reasons against it, ``notes`` further remarks."""

    good: bool
    wrong: tuple[str, ...]
    notes: tuple[str, ...]


def judge(
    kind: CalibrationKind,
    seen: Sequence[int],
    errors: Sequence[str],
    turned: RotorRotation,
    *,
    words_told: bool = True,
) -> CalibrationResult:
    """Judge a calibration that has ended, without being aborted, in idle.

    ``seen`` are its states, ``errors`` the reported errors, a sentence each; ``words_told``: the module reported its error words.
    """
    missing = [
        f"{state_words(part)} was not seen among its states" for part in sorted(kind.parts - set(seen))
    ]
    wrong = [*errors, *missing, *_turned_wrongly(kind, turned)]
    return CalibrationResult(not wrong, tuple(wrong), tuple(_notes(kind, turned, words_told=words_told)))


def _turned_wrongly(kind: CalibrationKind, turned: RotorRotation) -> list[str]:
    if not kind.turns or not turned.heard:
        return []
    if turned.farthest < _TURNS:
        return [f"the rotor was not seen to turn: {turned.farthest:.4f} rotor turns at the most"]
    if abs(turned.now) > turned.farthest / 2.0:
        return [
            f"the rotor turned by {turned.farthest:.2f} rotor turns and did not come back: {turned.now:.2f} rotor turns off"
        ]
    return []


def _notes(kind: CalibrationKind, turned: RotorRotation, *, words_told: bool) -> list[str]:
    notes = []
    if not words_told:
        notes.append("its error words are not available over CAN: only its heartbeat was checked")
    if kind.turns and not turned.heard:
        notes.append("the angle that it turned is not known: it does not report its encoder count")
    elif turned.heard:
        way = turned.high - turned.low
        notes.append(
            f"the rotor was seen to turn over {way:.2f} rotor turns, {way * _DEGREES:.0f} degrees of the output at {GEAR_RATIO}:1"
        )
    return notes


# -- Rotation of a rotor, from counts within one turn that are frequent enough to determine the direction --------------


@dataclass(slots=True)
class RotorRotation:
    """Rotor turns from the first count: now, and the extremes in both directions; ``heard``: number of counts."""

    now: float = 0.0
    low: float = 0.0
    high: float = 0.0
    heard: int = 0
    _count: int = 0

    def take(self, count: int) -> None:
        """Take a count (0 to 16383). The shorter direction is assumed: the rotor must turn less than half a turn between two."""
        if self.heard:
            step = (count - self._count + TURN // 2) % TURN - TURN // 2
            self.now += step / TURN
        self._count, self.heard = count, self.heard + 1
        self.low, self.high = min(self.low, self.now), max(self.high, self.now)

    @property
    def farthest(self) -> float:
        """Rotor turns between the first and the farthest position."""
        return max(self.high, -self.low)


# -- The procedure -------------------------------------------------------------------------------------


_STATE, _COUNT = named("Set_Axis_State"), named("Get_Encoder_Count")
BEGINS = 2.0  # s until the heartbeat must show the calibration
LONGEST = 300.0  # s: the manual says to cancel it after five minutes
_COUNTS = 0.03  # s between two requests for the count
_WORD, _TRIES = 0.15, 2  # s to wait for an error word, and requests for it


_UNGUARDED = "its watchdog process has ended: nothing would end the calibration if this program were killed"


class CalibrationPhase(Enum):
    """Phase of the calibration."""

    BEGINNING = "asked for"
    RUNNING = "under way"
    READING = "reading its errors"


class Calibration(ModuleMotionProcedure):
    """One calibration and its observations. ``verdict`` is None if it was aborted; ``why`` is then the reason."""

    def __init__(
        self,
        node: int,
        kind: CalibrationKind,
        *,
        remote: bool = True,
        guarded: Callable[[], bool] = lambda: True,
    ) -> None:
        """``node`` 0 to 63; ``remote``: whether the bus carries remote frames.

        ``guarded`` returns whether the watchdog process of the calibration still runs; if it does not, the calibration is ended.

        Raises:
            ArgumentError: the node ID is invalid.
        """
        super().__init__(node)
        self.kind = kind
        self.verdict: CalibrationResult | None = None
        self.turned = RotorRotation()
        self._remote = remote
        self._guarded = guarded
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
        why = strange(last.state)
        if why:
            self._end(why)
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
        lost = self._pulse.lost(now) or ("" if self._guarded() else _UNGUARDED)
        if lost:  # checked first: a restarted module shows idle, too
            self._end(lost)
            return None
        return self._read(now) if self._phase is CalibrationPhase.READING else self._run(now)

    def _run(self, now: float) -> Outgoing | None:
        waits = self._phase is CalibrationPhase.BEGINNING
        if waits and now - self._begun > max(BEGINS, PERIODS * self._pulse.period):
            self._end("the module does not begin: its heartbeat still shows idle")
        elif too_far(self.kind, self.turned):
            self._end(too_far(self.kind, self.turned))
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
            errors = reported_errors(last, self._words)
            self.verdict = judge(self.kind, self._seen, errors, self.turned, words_told=bool(self._words))
            self.left, self.stage = (
                f"module {self.node} is idle according to its heartbeat",
                ModuleMotionStage.DONE,
            )
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
