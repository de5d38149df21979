"""LSS fast scan (CiA 305): find every slave without a node-ID, one after another, by its address bit by bit.

Theory of operation
-------------------
A slave in *waiting* without a node-ID answers a request if its part ``LSSSub`` agrees with ``IDNumber`` from bit 31 down to
``BitCheck``. All matching slaves answer at once with the same frame, so an answer means "at least one". The search follows the
lowest address:

* For each bit the master first requests the prefix with a 0. Silence means that no slave has it; then the prefix with a 1 *must* be
  answered. So every bit is confirmed by an answer. If a frame is lost, both prefixes stay unanswered, and the master repeats both
  with a longer wait.
* A complete part is confirmed with ``LSSNext`` = the following part, and the slaves that agree advance to that part. After the last
  part the one remaining slave switches to *configuration*, where fast scan does not reach it. The next search finds the next slave.
* If answers contradict each other, the search for this slave starts again. The cause is an answer so late that it was taken for the
  next one, or a confirmation lost after the slave had advanced. The parts that were complete are then only guesses, at one request
  each. So are the first three parts of the slave found before: machines often have several of a kind.
* If the very last confirmation is lost, the slave may be in *configuration* already. The master then switches all slaves to
  *waiting*, and sets aside those found before, by switch state selective. The same service then shows whether the new slave exists.

A slave may continue to answer in *configuration*. Two signs show it: a slave is found again although it was set aside, or answers
contradict each other after a slave was found. ``ExcludingScan`` then searches the rest; it walks around such slaves.

When the scan ends, every slave found is in *configuration*, and one that continues to answer is in *waiting*. The scan changes
nothing else in the slaves.
"""

from __future__ import annotations

from axisbus.cia305.dialogue import AdaptiveLssTimeout, Dialogue, all_waiting, ask, say, select
from axisbus.cia305.exclude import RESTARTS, ExcludingScan
from axisbus.cia305.scan_result import KnownIdentity, Scanned, Unconfigured
from axisbus.cia305.services import ALL_BITS, LssAddress, LssState, fastscan, switch_global
from axisbus.errors import LssError, LssTimeout
from axisbus.wording import counted

_MOST = 127  # a network has no more node-IDs
_PARTS = 4
_BITS = 32


class _ContradictionError(Exception):
    """No slave matches the earlier answers; never leaves this module."""


class _AnswersOnError(Exception):
    """A slave that was found seems to continue to answer; never leaves this module."""


class _NobodyKnownError(Exception):
    """No slave is left that has the numbers in ``KnownIdentity``; never leaves this module."""


class FastScan:
    """One scan; holds the slaves found, the guesses for the next slave, and the addresses found twice."""

    def __init__(
        self, pace: AdaptiveLssTimeout, known: KnownIdentity | None = None, most: int = _MOST
    ) -> None:
        """Prepare a scan that ends after ``most`` slaves."""
        self._pace = pace
        self._wanted = known or KnownIdentity()
        self._known = self._wanted.parts
        self._most = most
        self._guess: list[int | None] = [None] * _PARTS
        self._again: set[LssAddress] = set()
        self.found: list[Unconfigured] = []

    def run(self) -> Dialogue[Scanned]:
        """Find all slaves.

        Raises:
            LssTimeout: a slave went silent; LssError: answers contradict each other again and again.
        """
        try:
            yield from all_waiting(self._pace)
            others = yield from self._one_by_one()
        except _AnswersOnError:
            return (yield from ExcludingScan(self._pace, self._wanted, self._most, self.found).run())
        return Scanned(tuple(sorted(self.found, key=lambda each: each.address)), others)

    def _one_by_one(self) -> Dialogue[bool]:
        """Return whether slaves are left that do not match ``KnownIdentity``."""
        while len(self.found) < self._most and (yield from self._anybody()):
            try:
                slave = yield from self._next()
            except _NobodyKnownError:
                return True
            yield from self._remember(slave)
        return False

    def _remember(self, slave: Unconfigured) -> Dialogue[None]:
        """Note a slave; if a found slave stayed in *waiting*, set it aside by switch state selective, once."""
        self._guess = [*slave.address.parts[: _PARTS - 1], None]
        if slave.address not in [each.address for each in self.found]:
            self.found.append(slave)
            return
        if slave.address in self._again:
            raise _AnswersOnError
        self._again.add(slave.address)
        yield from select(self._pace, slave.address)

    def _anybody(self) -> Dialogue[bool]:
        """Begin a search: reset the scan of all slaves to the first part, and return whether any slave answers."""
        pace = self._pace
        for _ in range(pace.timing.tries):
            heard = yield from ask(pace, fastscan(0, ALL_BITS, 0, 0), pace.patience, found=len(self.found))
            if heard.answers:
                return True
        return False

    def _next(self) -> Dialogue[Unconfigured]:
        for attempt in range(RESTARTS):
            if attempt > 1:  # one contradiction may be an accident
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
        """Return the number of answers from slaves that agree down to ``bit``."""
        done = sub * _BITS + _BITS - bit if following == sub else (sub + 1) * _BITS
        frame = fastscan(value, bit, sub, following)
        heard = yield from ask(self._pace, frame, wait, found=len(self.found), bits=done)
        return len(heard.answers)

    def _exists(self, address: LssAddress) -> Dialogue[int]:
        """Return how many slaves have ``address``; they and all slaves found before are then in *configuration*."""
        pace = self._pace
        for _ in range(pace.timing.tries):
            yield from all_waiting(pace)
            yield from say(pace, switch_global(LssState.WAITING), pace.patience)  # for late answers
            for slave in self.found:
                yield from select(pace, slave.address)
            count = yield from select(pace, address, pace.timeout)
            if count:
                return count
        return 0
