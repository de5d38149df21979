"""LSS fast scan (CiA 305): finds every slave without a node-ID, one after another, by asking for its address bit by bit.

Theory of operation
-------------------
Slaves in *waiting* without a node-ID answer a request when their part ``LSSSub`` agrees with ``IDNumber`` from bit 31 down to
``BitCheck``. Several answer at once with the same frame, so an answer means "somebody", and the search follows the lowest address:

* bit by bit the prefix with a 0 is asked for; silence means that nobody has it, and then the prefix with a 1 *must* be answered. So
  every bit is confirmed by an answer, and a lost frame shows as silence to both, which is asked again with more patience.
* a part that is complete is confirmed with ``LSSNext`` = the following part, and the slaves that agree go on to that. After the
  last part the one slave left switches to *configuration*, where fast scan does not reach it, and the next search finds the next.
* answers that contradict each other (an answer came so late that it was taken for the next one's, or a confirmation was lost after
  the slave had moved on) begin the search for this slave again. The parts that were complete are then only guesses, at one request
  each, as are the first three parts of the slave found before: machines often have several of a kind.
* if the very last confirmation is lost, the slave may be in *configuration* already. All are then switched to *waiting*, those
  found before are put aside by selective switching, and selective switching says whether the new one exists.

A slave that is found again although it was put aside, or answers that contradict each other after somebody was found, mean that a
slave goes on answering in *configuration*: the rest is then searched by ``lss_exclude``, which walks around such slaves.

Every slave that was found is in *configuration* when the scan ends (one that answers on is in *waiting*); nothing else about it has
changed.
"""

from __future__ import annotations

from axisbus.cia305.dialogue import AdaptiveLssTimeout, Dialogue, all_waiting, ask, say, select
from axisbus.cia305.exclude import RESTARTS, ExcludingScan
from axisbus.cia305.scan_result import KnownIdentity, Scanned, Unconfigured
from axisbus.cia305.services import ALL_BITS, LssAddress, LssState, fastscan, switch_global
from axisbus.errors import LssError, LssTimeout
from axisbus.wording import counted

_MOST = 127  # there are no more node-IDs
_PARTS = 4
_BITS = 32


class _ContradictionError(Exception):
    """Nobody is what earlier answers said; never leaves this module."""


class _AnswersOnError(Exception):
    """Somebody who was found seems to go on answering; never leaves this module."""


class _NobodyKnownError(Exception):
    """Nobody is left who has the numbers in ``KnownIdentity``; never leaves this module."""


class FastScan:
    """One scan; holds the slaves found, the guesses for the next, and who was found twice."""

    def __init__(
        self, pace: AdaptiveLssTimeout, known: KnownIdentity | None = None, most: int = _MOST
    ) -> None:
        """Prepare; ``most`` ends the scan after so many slaves."""
        self._pace = pace
        self._wanted = known or KnownIdentity()
        self._known = self._wanted.parts
        self._most = most
        self._guess: list[int | None] = [None] * _PARTS
        self._again: set[LssAddress] = set()
        self.found: list[Unconfigured] = []

    def run(self) -> Dialogue[Scanned]:
        """Find them all.

        Raises:
            LssTimeout: a slave went silent; LssError: answers go on contradicting each other.
        """
        try:
            yield from all_waiting(self._pace)
            others = yield from self._one_by_one()
        except _AnswersOnError:
            return (yield from ExcludingScan(self._pace, self._wanted, self._most, self.found).run())
        return Scanned(tuple(sorted(self.found, key=lambda each: each.address)), others)

    def _one_by_one(self) -> Dialogue[bool]:
        """Return whether somebody is left who is not as ``KnownIdentity`` says."""
        while len(self.found) < self._most and (yield from self._anybody()):
            try:
                slave = yield from self._next()
            except _NobodyKnownError:
                return True
            yield from self._remember(slave)
        return False

    def _remember(self, slave: Unconfigured) -> Dialogue[None]:
        """Note a slave; one that stayed in *waiting* although it was found is put aside by selective switching, once."""
        self._guess = [*slave.address.parts[: _PARTS - 1], None]
        if slave.address not in [each.address for each in self.found]:
            self.found.append(slave)
            return
        if slave.address in self._again:
            raise _AnswersOnError
        self._again.add(slave.address)
        yield from select(self._pace, slave.address)

    def _anybody(self) -> Dialogue[bool]:
        """Begin a search: everybody is asked, and everybody begins at the first part."""
        pace = self._pace
        for _ in range(pace.timing.tries):
            heard = yield from ask(pace, fastscan(0, ALL_BITS, 0, 0), pace.patience, found=len(self.found))
            if heard.answers:
                return True
        return False

    def _next(self) -> Dialogue[Unconfigured]:
        for attempt in range(RESTARTS):
            if attempt > 1:  # once is an accident
                if self.found:
                    raise _AnswersOnError
                self._pace.distrust()
            if attempt and not (yield from self._anybody()):
                raise self._gone()
            try:
                return (yield from self._search())
            except _ContradictionError:
                continue
        raise LssError(
            f"the LSS fast scan found no slave {len(self.found) + 1}, although one answers",
            service="fastscan",
            observed=f"answers contradicted each other in {RESTARTS} searches; "
            f"the last wait was {self._pace.timeout * 1000:.0f} ms",
            remedy="raise --timeout for slow slaves; check cable and termination; see whether a second LSS master is on the bus",
        )

    def _gone(self) -> LssTimeout:
        return LssTimeout(
            f"LSS slave {len(self.found) + 1} went silent while the fast scan was asking for its address",
            service="fastscan",
            observed=f"no answer any more, {counted(self._pace.timing.tries, 'request')}, {self._pace.patience * 1000:.0f} ms each",
            remedy="check its supply and cable, and scan again",
        )

    def _search(self) -> Dialogue[Unconfigured]:
        parts: list[int] = []
        answers = 0
        for sub in range(_PARTS):
            value = yield from self._part(sub)
            parts.append(value)
            self._guess[sub] = value
            following = (sub + 1) % _PARTS
            answers = yield from self._matches(sub, value, 0, following)
            if not answers and following:
                raise _ContradictionError
        address = LssAddress(*parts)
        if answers != 1:
            answers = yield from self._exists(address)
        if not answers:
            raise _ContradictionError
        return Unconfigured(address, twins=answers > 1)

    def _part(self, sub: int) -> Dialogue[int]:
        """Find one number of the lowest address that is left."""
        known = self._known[sub]
        if known is not None:
            for _ in range(self._pace.timing.tries):
                if (yield from self._matches(sub, known, 0, sub)):
                    return known
            raise _NobodyKnownError
        guess = self._guess[sub]
        if guess is not None and (yield from self._matches(sub, guess, 0, sub)):
            return guess
        value = 0
        for bit in reversed(range(_BITS)):
            value = yield from self._bit(sub, bit, value)
        return value

    def _bit(self, sub: int, bit: int, value: int) -> Dialogue[int]:
        """Return ``value`` with this bit decided."""
        for attempt in range(self._pace.timing.tries):
            wait = self._pace.timeout * 2**attempt
            for candidate in (value, value | 1 << bit):
                if (yield from self._matches(sub, candidate, bit, sub, wait)):
                    return candidate
        raise _ContradictionError

    def _matches(
        self, sub: int, value: int, bit: int, following: int, wait: float | None = None
    ) -> Dialogue[int]:
        """Return how many answers say that somebody agrees down to ``bit``."""
        done = sub * _BITS + _BITS - bit if following == sub else (sub + 1) * _BITS
        frame = fastscan(value, bit, sub, following)
        heard = yield from ask(self._pace, frame, wait, found=len(self.found), bits=done)
        return len(heard.answers)

    def _exists(self, address: LssAddress) -> Dialogue[int]:
        """Return how many slaves have ``address``, with them and all that were found before in *configuration*."""
        pace = self._pace
        for _ in range(pace.timing.tries):
            yield from all_waiting(pace)
            yield from say(pace, switch_global(LssState.WAITING), pace.patience)  # what is late may come
            for slave in self.found:
                yield from select(pace, slave.address)
            count = yield from select(pace, address, pace.timeout)
            if count:
                return count
        return 0
