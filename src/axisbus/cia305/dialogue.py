"""How an LSS master and its slaves talk, without a bus or a clock: requests and waits out, answers with their delays in.

Theory of operation
-------------------
A *dialogue* is a generator. It yields an ``LssRequest`` (a frame, which answers count, how long to wait) and is sent ``LssReplies``
(what came, each answer with the seconds since its request). Whoever runs it owns bus and clock: ``axisbus.bus.lss`` does so in real
time, a test in no time at all.

LSS answers carry no number that ties them to a request, and silence is an answer too: in a fast scan it means "nobody". So the wait
decides between right and wrong, and ``AdaptiveLssTimeout`` sets it: at least ``floor``, and half as long again as the slowest
answer seen. After an answer the line is listened to for ``settle``, so that what slower slaves say to this request is not taken for
the next one's.
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

_MARGIN = 1.5  # on the slowest answer seen
_RESULT = 3  # bytes of an answer with an error code and the maker's own; what is cut short tells none
_NUMBERS = {**dict.fromkeys(INQUIRIES, 5), LssService.INQUIRE_NODE_ID: 2}  # bytes of the others
CONFIRM_WAIT = 0.5  # s for a confirmed service at its first try; costs only where nobody answers
STORE_WAIT = 5.0  # s; some memories are erased first


class LssReply(NamedTuple):
    """A frame from a slave, and the seconds since the request was sent."""

    data: bytes
    delay: float


class LssReplies(NamedTuple):
    """The answers to an ``LssRequest`` of the expected kind, and the delays of answers too late for an earlier request."""

    answers: tuple[LssReply, ...] = ()
    late: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class LssRequest:
    """Send ``frame``; wait ``wait`` s for an answer that begins with ``expects`` (None: just wait), then ``settle`` s for more.

    ``found`` and ``bits`` (0 to 128) tell how far a scan has come.
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
    """Waits in s. ``floor``: the least wait for an answer, to be raised for slow slaves. ``first``: the wait while nothing is
    known of the slaves, and where silence means that none is left. ``gap``: after an answer, and after a request that has none.
    ``ceiling``: the most that the wait may grow to. ``tries``: how often each request is sent before it counts as unanswered.
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
    """How long to wait; holds the delays seen, and how much trust is left in them."""

    def __init__(self, timing: LssTiming | None = None) -> None:
        self.timing = timing or LssTiming()
        self.slowest: float | None = None
        self._spread = 0.0
        self._factor = 1.0

    @property
    def timeout(self) -> float:
        """Seconds after which no answer means that nobody answers."""
        timing = self.timing
        if self.slowest is None:
            return max(timing.floor, timing.first)
        return min(timing.ceiling, self._factor * max(timing.floor, _MARGIN * self.slowest))

    @property
    def patience(self) -> float:
        """Seconds to wait where a whole search ends on silence."""
        return max(self.timeout, self.timing.first)

    @property
    def settle(self) -> float:
        """Seconds to go on listening after an answer; no more than the ceiling, however long somebody goes on talking."""
        settled = max(self.timing.gap, _MARGIN * self._spread)
        return min(self.timing.ceiling, settled if self._factor == 1.0 else max(settled, self.timeout))

    def learn(self, heard: LssReplies) -> None:
        """Take note of how quick the slaves are."""
        delays = [answer.delay for answer in heard.answers]
        if len(delays) > 1:
            self._spread = max(self._spread, delays[-1] - delays[0])
        for delay in (*delays, *heard.late):
            self.slowest = max(delay, self.slowest or 0.0)

    def distrust(self) -> None:
        """Answers contradicted each other: wait twice as long from now on, and listen as long after every answer."""
        self._factor *= 2.0


def ask(
    pace: AdaptiveLssTimeout, frame: bytes, wait: float | None = None, *, found: int = 0, bits: int = 0
) -> Dialogue[LssReplies]:
    """Send a frame once; wait for its answers (``wait`` s instead of the pace's) and learn from them."""
    expects = ANSWERS[LssService(frame[0])]
    heard = yield LssRequest(frame, expects, pace.timeout if wait is None else wait, pace.settle, found, bits)
    pace.learn(heard)
    return heard


def say(pace: AdaptiveLssTimeout, frame: bytes, pause: float | None = None) -> Dialogue[None]:
    """Send a frame that has no answer, and give the slaves ``pause`` s (None: the pace's gap)."""
    pace.learn((yield LssRequest(frame, None, pace.timing.gap if pause is None else pause)))


def all_waiting(pace: AdaptiveLssTimeout) -> Dialogue[None]:
    """Switch every slave to *waiting*; twice, because nobody would tell that one had not heard it and obeys the next request."""
    for _ in range(2):
        yield from say(pace, switch_global(LssState.WAITING))


def select(pace: AdaptiveLssTimeout, address: LssAddress, pause: float | None = None) -> Dialogue[int]:
    """Switch one slave from *waiting* to *configuration*, once; return how many answered."""
    *numbers, last = switch_selective(address)
    for frame in numbers:
        yield from say(pace, frame, pause)
    heard = yield from ask(pace, last, pace.patience)
    return len(heard.answers)


def enter(pace: AdaptiveLssTimeout, address: LssAddress | None) -> Dialogue[None]:
    """Have exactly one slave in *configuration*: that with ``address``, or (None) every slave, where there is only one.

    Raises:
        LssTimeout: no slave has this address.
        LssError: several have.
    """
    for attempt in range(pace.timing.tries):
        yield from all_waiting(pace)
        if address is None:
            yield from say(pace, switch_global(LssState.CONFIGURATION))
            return
        # A slave that lost a number of the address may need more time between them.
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
    """Return how many answer to an address when all that was late has had time to come."""
    yield from all_waiting(pace)
    yield from say(pace, switch_global(LssState.WAITING), pace.patience)
    return (yield from select(pace, address))


def duplicate_addresses(address: LssAddress, count: int) -> LssError:
    """Return the error that ``count`` slaves answer to one address."""
    return LssError(
        f"{counted(count, 'LSS slave')} have the same identity {address}",
        service=LssService.SWITCH_STATE_SELECTIVE.text,
        slave=str(address),
        observed=f"{counted(count, 'answer')} to one switch state selective",
        remedy="LSS cannot tell them apart: connect one at a time, and have their serial numbers set",
    )


def absent(pace: AdaptiveLssTimeout, address: LssAddress) -> LssTimeout:
    """Return the error that nobody answers to an address."""
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
    """Carry out a confirmed service with the slave in *configuration* (``many``: with all of them); return its answer.

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
        # At a later try the same answer again may be the late one to the try before.
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
        remedy="name the slave by its identity; where two have the same one, connect them one at a time",
    )


def configured(
    pace: AdaptiveLssTimeout, frame: bytes, slave: str, wait: float = CONFIRM_WAIT, *, many: bool = False
) -> Dialogue[None]:
    """Carry out one of the services that answer with an error code.

    Raises:
        LssRefused: the slave says no.
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
