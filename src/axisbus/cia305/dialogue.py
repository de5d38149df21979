"""The dialogue of an LSS master with its slaves, independent of bus and clock.

Theory of operation
-------------------
A *dialogue* is a generator. It yields an ``LssRequest``: a frame, the kind of answer that it expects, and the time to wait. The
caller sends back ``LssReplies``: the answers, each with the seconds since its request. The caller owns the bus and the clock.
``axisbus.bus.lss`` runs dialogues in real time; tests run them without waiting.

An LSS answer contains no number that assigns it to a request. Silence is an answer too: in a fast scan it means that no slave
matches. The length of the wait therefore decides whether a result is right. ``AdaptiveLssTimeout`` sets it to the larger of
``floor`` and 1.5 times the delay of the slowest answer seen, but no more than ``ceiling``. After an answer the master listens for
another ``settle`` seconds, so that it does not take answers of slower slaves for answers to the next request.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from axisbus.cia305.services import (
    ANSWERS,
    INQUIRIES,
    LssAddress,
    LssService,
    LssState,
    refusal,
    switch_global,
    switch_selective,
)
from axisbus.errors import ArgumentError, LssError, LssRefused, LssTimeout
from axisbus.wording import counted

T = TypeVar("T")

_MARGIN = 1.5  # factor on the delay of the slowest answer seen
_RESULT = 3  # bytes of an answer with error code and manufacturer-specific error; a shorter one has neither
_NUMBERS = {**dict.fromkeys(INQUIRIES, 5), LssService.INQUIRE_NODE_ID: 2}  # bytes of the others
CONFIRM_WAIT = 0.5  # s for a confirmed service at its first try; only an unanswered request takes that long
STORE_WAIT = 5.0  # s; some memories are erased first


class LssReply(NamedTuple):
    """A frame from a slave, and the seconds since the request was sent."""

    data: bytes
    delay: float


class LssReplies(NamedTuple):
    """Answers of the expected kind to an ``LssRequest``, and delays (s) of answers that came too late for an earlier request."""

    answers: tuple[LssReply, ...] = ()
    late: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class LssRequest:
    """Send ``frame``; wait ``wait`` s for an answer that begins with ``expects`` (None: only wait), then ``settle`` s for more.

    ``found`` (slaves) and ``bits`` (0 to 128) are the progress of a scan.
    """

    frame: bytes
    expects: LssService | None
    wait: float
    settle: float = 0.0
    found: int = 0
    bits: int = 0


Dialogue = Generator[LssRequest, LssReplies, T]


@dataclass(frozen=True, slots=True)
class LssTiming:
    """Waiting times in seconds.

    - ``floor``: the minimum wait for an answer; raise it for slow slaves.
    - ``first``: the wait before any delay of the slaves is known, and the minimum wait if silence means that no slave is left.
    - ``gap``: the minimum time to listen after an answer, and the pause after a request that has no answer.
    - ``ceiling``: the maximum wait.
    - ``tries``: how often each request is sent before it counts as unanswered.
    """

    floor: float = 0.015
    first: float = 0.2
    gap: float = 0.002
    ceiling: float = 2.0
    tries: int = 3

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ArgumentError: one is out of range.
        """
        if not 0.001 <= self.floor <= self.ceiling <= 60.0:
            raise ArgumentError(
                f"an LSS time-out of {self.floor:g} s cannot be used",
                remedy=f"give one from 0.001 to {self.ceiling:g} s",
            )
        if self.gap < 0.0 or self.first <= 0.0 or self.tries < 1:
            raise ArgumentError("LSS waits must be positive, and tries at least 1")


class AdaptiveLssTimeout:
    """Waiting times of a dialogue; holds the delays seen so far, and a factor that grows when answers contradict each other."""

    def __init__(self, timing: LssTiming | None = None) -> None:
        self.timing = timing or LssTiming()
        self.slowest: float | None = None
        self._spread = 0.0
        self._factor = 1.0

    @property
    def timeout(self) -> float:
        """Seconds without an answer after which no slave is assumed to answer."""
        timing = self.timing
        if self.slowest is None:
            return max(timing.floor, timing.first)
        return min(timing.ceiling, self._factor * max(timing.floor, _MARGIN * self.slowest))

    @property
    def patience(self) -> float:
        """Seconds to wait for an answer if silence ends a whole search."""
        return max(self.timeout, self.timing.first)

    @property
    def settle(self) -> float:
        """Seconds to listen after an answer, at most ``ceiling``, even if slaves continue to answer."""
        settled = max(self.timing.gap, _MARGIN * self._spread)
        return min(self.timing.ceiling, settled if self._factor == 1.0 else max(settled, self.timeout))

    def learn(self, heard: LssReplies) -> None:
        """Update the slowest delay and the spread of the delays."""
        delays = [answer.delay for answer in heard.answers]
        if len(delays) > 1:
            self._spread = max(self._spread, delays[-1] - delays[0])
        for delay in (*delays, *heard.late):
            self.slowest = max(delay, self.slowest or 0.0)

    def distrust(self) -> None:
        """Double the wait after answers that contradicted each other, and listen at least as long after every answer."""
        self._factor *= 2.0


def ask(
    pace: AdaptiveLssTimeout, frame: bytes, wait: float | None = None, *, found: int = 0, bits: int = 0
) -> Dialogue[LssReplies]:
    """Send a frame once, wait for its answers (``wait`` s; None: the timeout of ``pace``) and learn from their delays."""
    expects = ANSWERS[LssService(frame[0])]
    heard = yield LssRequest(frame, expects, pace.timeout if wait is None else wait, pace.settle, found, bits)
    pace.learn(heard)
    return heard


def say(pace: AdaptiveLssTimeout, frame: bytes, pause: float | None = None) -> Dialogue[None]:
    """Send a frame that has no answer, then pause ``pause`` s (None: the gap of ``pace``)."""
    pace.learn((yield LssRequest(frame, None, pace.timing.gap if pause is None else pause)))


def all_waiting(pace: AdaptiveLssTimeout) -> Dialogue[None]:
    """Switch every slave to *waiting*, twice: no answer would show that a slave missed the frame and obeys the next request."""
    for _ in range(2):
        yield from say(pace, switch_global(LssState.WAITING))


def select(pace: AdaptiveLssTimeout, address: LssAddress, pause: float | None = None) -> Dialogue[int]:
    """Switch one slave from *waiting* to *configuration* with one attempt; return the number of answers."""
    *numbers, last = switch_selective(address)
    for frame in numbers:
        yield from say(pace, frame, pause)
    heard = yield from ask(pace, last, pace.patience)
    return len(heard.answers)


def enter(pace: AdaptiveLssTimeout, address: LssAddress | None) -> Dialogue[None]:
    """Switch exactly one slave to *configuration*: the one with ``address``; if None, all slaves, which must be only one.

    Raises:
        LssTimeout: no slave has this address.
        LssError: several slaves have it.
    """
    for attempt in range(pace.timing.tries):
        yield from all_waiting(pace)
        if address is None:
            yield from say(pace, switch_global(LssState.CONFIGURATION))
            return
        # A slave that missed one of the four numbers may need more time between them.
        count = yield from select(pace, address, pace.timeout if attempt else None)
        if count > 1:
            count = yield from count_again(pace, address)
        if count > 1:
            raise duplicate_addresses(address, count)
        if count:
            return
    assert address is not None
    raise absent(pace, address)


def count_again(pace: AdaptiveLssTimeout, address: LssAddress) -> Dialogue[int]:
    """Return the number of slaves that answer to an address, after a pause in which late answers can arrive."""
    yield from all_waiting(pace)
    yield from say(pace, switch_global(LssState.WAITING), pace.patience)
    return (yield from select(pace, address))


def duplicate_addresses(address: LssAddress, count: int) -> LssError:
    """Return the error for ``count`` slaves that answer to one address."""
    return LssError(
        f"{counted(count, 'LSS slave')} have the same identity {address}",
        service=LssService.SWITCH_STATE_SELECTIVE.text,
        slave=str(address),
        observed=f"{counted(count, 'answer')} to one switch state selective",
        remedy="LSS cannot distinguish them: connect one at a time, and have their serial numbers set",
    )


def absent(pace: AdaptiveLssTimeout, address: LssAddress) -> LssTimeout:
    """Return the error for an address that no slave answers to."""
    return LssTimeout(
        f"no LSS slave has the identity {address}",
        service=LssService.SWITCH_STATE_SELECTIVE.text,
        slave=str(address),
        observed=f"no answer to switch state selective, {counted(pace.timing.tries, 'try', 'tries')}, "
        f"{pace.patience * 1000:.0f} ms each",
        remedy="check supply, cable and bit rate, and the four numbers (axisbus lss find shows slaves without node-ID, "
        "axisbus scan those with one); raise --timeout for a slow slave",
    )


def confirmed(
    pace: AdaptiveLssTimeout, frame: bytes, slave: str, wait: float = CONFIRM_WAIT, *, many: bool = False
) -> Dialogue[bytes]:
    """Request a confirmed service from the slave in *configuration* (``many``: from all slaves there); return the answer.

    Raises:
        LssTimeout: no answer, after all tries.
        LssError: several slaves answered.
    """
    service = LssService(frame[0])
    for attempt in range(pace.timing.tries):
        heard = yield from ask(pace, frame, max(wait, pace.timeout))
        whole = [
            answer.data for answer in heard.answers if len(answer.data) >= _NUMBERS.get(service, _RESULT)
        ]
        answers = [data.ljust(8, b"\0") for data in whole]
        # From the second try on, a second equal answer may be the late answer to the try before.
        if len(set(answers)) > 1 or (len(answers) > 1 and not attempt and not many):
            raise _several(service, slave, answers)
        if answers:
            return answers[0]
    raise LssTimeout(
        f"{slave} did not answer {service.text}",
        service=service.text,
        slave=slave,
        observed=f"{counted(pace.timing.tries, 'request')}, {max(wait, pace.timeout):g} s each",
        remedy="the slave may not have this service (it is then silent), or is gone: check it with axisbus lss inquire",
    )


def _several(service: LssService, slave: str, answers: list[bytes]) -> LssError:
    return LssError(
        f"several LSS slaves answered {service.text}",
        service=service.text,
        slave=slave,
        observed=" and ".join(answer.hex(" ") for answer in answers),
        remedy="name the slave by its identity; if two have the same identity, connect them one at a time",
    )


def configured(
    pace: AdaptiveLssTimeout, frame: bytes, slave: str, wait: float = CONFIRM_WAIT, *, many: bool = False
) -> Dialogue[None]:
    """Request a service whose answer contains an error code.

    Raises:
        LssRefused: the slave reported an error.
        LssTimeout, LssError: as ``confirmed``.
    """
    answer = yield from confirmed(pace, frame, slave, wait, many=many)
    code, specific = answer[1], answer[2]
    if code:
        service = LssService(frame[0])
        text, remedy = refusal(service, code, specific)
        raise LssRefused(
            f"{slave} refused {service.text}: {text}",
            service=service.text,
            slave=slave,
            code=code,
            specific=specific,
            observed=f"answer {answer.hex(' ')} (error code {code}, specific {specific})",
            remedy=remedy,
        )
