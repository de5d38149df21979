"""LSS fast scan on a bus with slaves that continue to answer after they were found.

Theory of operation
-------------------
By CiA 305 a slave answers fast scan only in *waiting*. Once found, a slave is in *configuration* and silent. Some slaves continue
to answer there, so the usual search finds them again and again. Answers contain no address. The answers of such a slave cannot be
distinguished from those of others, except in branches of the address tree that do not contain its address. Therefore:

* Each found slave is set aside: it is selected alone by switch state selective, then asked once more by its own address. If it is
  silent, it stays in *configuration*. If it answers, it is *excluded*: the master reads its numbers and leaves it in *waiting*,
  where it answers by its address.
* The master walks the tree from its root. If a branch contains an excluded slave, the master looks at both halves. Otherwise it
  sends a request for the branch. Silence closes the branch. An answer can only come from another slave, and the master then
  searches for that slave in this branch.
* Silence may also mean a lost frame. The walk therefore ends only after ``WALKS`` passes through the whole tree without a new
  slave.

The result reports two uncertainties. LSS cannot show whether another slave has the same address as an excluded one. The search is
given up if too many addresses are answered although no slave can be selected by them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from axisbus.cia305.dialogue import AdaptiveLssTimeout, Dialogue, all_waiting, ask, say, select
from axisbus.cia305.master import numbers_of
from axisbus.cia305.scan_result import Check, KnownIdentity, Scanned, Unconfigured
from axisbus.cia305.services import ALL_BITS, LssAddress, LssState, fastscan, switch_global
from axisbus.errors import LssError

WALKS = 2  # passes through the whole tree without a new slave
RESTARTS = 6  # searches in one branch; from the third on, each waits twice as long as the last
MOST_DOUBTFUL = 3  # addresses that are answered but cannot be selected


GIVEN_UP = (
    f"more than {MOST_DOUBTFUL} addresses were answered, but no slave can be selected by them: most likely a slave answers "
    "every fast scan request and hides the others; disconnect it to find them"
)
CONTRADICTED = (
    "answers contradicted each other in the range from {low} to {high}: a slave there was possibly not found"
)


class _NobodyError(Exception):
    """A branch was answered, but neither of its halves; never leaves this module."""


class _OthersError(Exception):
    """The slaves that answered for a branch do not match ``KnownIdentity``; never leaves this module."""


class ExcludingScan:
    """The rest of a scan; holds the slaves set aside in *configuration*, the excluded slaves, and the branches still open."""

    def __init__(
        self, pace: AdaptiveLssTimeout, known: KnownIdentity, most: int, found: Sequence[Unconfigured]
    ) -> None:
        """Prepare; ``found`` are the results of the usual search, each checked first; ``most`` limits the number of slaves."""
        self._pace = pace
        self._known = known.parts
        self._most = most
        self._candidates = list(found)
        self._aside: list[Unconfigured] = []
        self._excluded: list[Unconfigured] = []
        self._open: list[Branch] = []
        self._searches: dict[Branch, int] = {}
        self._others = False
        self._seen_others = False
        self._incomplete = ""
        self._questions = Questions(pace, lambda: len(self._found))

    @property
    def _found(self) -> list[Unconfigured]:
        return [*self._aside, *self._excluded]

    def run(self) -> Dialogue[Scanned]:
        """Find all slaves; at the end slaves set aside are in *configuration*, excluded slaves in *waiting*."""
        for slave in self._candidates:
            yield from self._sort_out(slave.address, slave.twins)
        walks = 0
        while walks < WALKS and not self._is_over():
            count = len(self._found)
            yield from self._walk()
            self._seen_others = True
            walks = 0 if len(self._found) > count else walks + 1
        slaves = [slave for slave in self._found if not (self._gave_up and slave.check is Check.UNSELECTABLE)]
        return Scanned(tuple(sorted(slaves, key=lambda each: each.address)), self._others, self._incomplete)

    @property
    def _gave_up(self) -> bool:
        return self._incomplete == GIVEN_UP

    def _is_over(self) -> bool:
        doubtful = sum(slave.check is Check.UNSELECTABLE for slave in self._excluded)
        if doubtful > MOST_DOUBTFUL:
            self._incomplete = GIVEN_UP
        return self._gave_up or len(self._found) >= self._most

    # -- the tree -----------------------------------------------------------------------------------------------------------------

    def _walk(self) -> Dialogue[None]:
        """Pass through all branches once; a branch in which a slave was found is looked at again."""
        yield from self._put_aside()
        self._open = [ROOT]
        while self._open and not self._is_over():
            branch = self._open.pop()
            if branch.depth == 0 or any(branch.holds(slave.address) for slave in self._excluded):
                self._open += reversed(branch.children if branch.depth < DEPTH else ())
            else:
                yield from self._look(branch)

    def _look(self, branch: Branch) -> Dialogue[None]:
        """Send a request for a branch that contains no excluded slave."""
        if not branch.within(self._known) and (self._others or self._seen_others):
            return  # slaves that do not match are only mentioned, and one walk is enough for that
        if not (yield from self._questions.anybody(branch)):
            return
        try:
            leaf = yield from self._descend(branch)
        except _OthersError:
            self._others = True
        except _NobodyError:
            self._search_again(branch)
        else:
            count = len(self._found)
            yield from self._sort_out(leaf.address)
            if len(self._found) > count:
                self._open.append(branch)
            else:  # no slave has this address, or a slave that was set aside answered again
                self._search_again(branch)

    def _search_again(self, branch: Branch) -> None:
        count = self._searches[branch] = self._searches.get(branch, 0) + 1
        self._questions.forget()
        if count > 1:  # one contradiction may be an accident
            self._pace.distrust()
        if count < RESTARTS:
            self._open.append(branch)
        else:
            last = Branch(branch.bits | (1 << DEPTH - branch.depth) - 1, DEPTH)
            self._incomplete = CONTRADICTED.format(low=branch.address, high=last.address)

    def _descend(self, branch: Branch) -> Dialogue[Branch]:
        """Return the leaf of a slave in a branch that was answered: the lowest address unless a guess was right."""
        while branch.depth < DEPTH:
            branch = (yield from self._guessed(branch)) or (yield from self._half(branch))
        return branch

    def _guessed(self, branch: Branch) -> Dialogue[Branch | None]:
        """Descend a whole part if a slave has the same number as the last slave found: machines often have several of a kind."""
        if branch.depth % PART_BITS or not self._found:
            return None
        part = branch.depth // PART_BITS
        guess = branch.with_part(self._found[-1].address.parts[part])
        if part == 3 or not guess.within(self._known) or not (yield from self._questions.anybody(guess)):
            return None
        return guess

    def _half(self, branch: Branch) -> Dialogue[Branch]:
        wanted = [half for half in branch.children if half.within(self._known)]
        for attempt in range(self._pace.timing.tries):
            for half in wanted:
                if (yield from self._questions.anybody(half, self._pace.timeout * 2**attempt)):
                    return half
        for half in branch.children:
            if half not in wanted and (yield from self._questions.anybody(half)):
                raise _OthersError
        if not wanted:
            raise _OthersError
        raise _NobodyError

    # -- one slave ----------------------------------------------------------------------------------------------------------------

    def _sort_out(self, address: LssAddress, twins: bool = False) -> Dialogue[None]:
        """Set a slave aside if it is silent in *configuration*, else exclude it; drop an address that no slave answers to."""
        before = [slave for slave in self._aside if slave.address == address]
        self._aside = [slave for slave in self._aside if slave.address != address]
        yield from self._put_aside()
        count = yield from self._select(address)
        answers_on = yield from self._questions.anybody_at_last(of(address))
        twins = twins or count > 1 or any(slave.twins for slave in before)
        if count and not answers_on:
            self._aside.append(Unconfigured(address, twins))
        elif answers_on:
            slave = yield from self._inquire(address, bool(count))
            self._excluded.append(Unconfigured(address, twins or answers_on > 1, True, *slave))
            yield from self._put_aside()

    def _put_aside(self) -> Dialogue[None]:
        """Switch the slaves that are silent in *configuration* to *configuration*, and all others to *waiting*."""
        yield from all_waiting(self._pace)
        for slave in self._aside:
            if not (yield from select(self._pace, slave.address)):
                yield from select(self._pace, slave.address, self._pace.timeout)
        self._questions.forget()

    def _select(self, address: LssAddress) -> Dialogue[int]:
        for attempt in range(self._pace.timing.tries):
            if attempt:
                yield from self._put_aside()
            count = yield from select(self._pace, address, self._pace.timeout if attempt else None)
            if count:
                return count
        return 0

    def _inquire(self, address: LssAddress, selectable: bool) -> Dialogue[tuple[Check, int | None]]:
        """Read the four numbers and the node-ID of a slave that is alone in *configuration*."""
        if not selectable:
            return Check.UNSELECTABLE, None
        for _ in range(self._pace.timing.tries):
            yield from all_waiting(self._pace)
            yield from say(
                self._pace, switch_global(LssState.WAITING), self._pace.patience
            )  # time for late answers to arrive
            if (yield from select(self._pace, address)):
                break
        try:
            numbers, node_id = yield from numbers_of(self._pace, address)
        except LssError:  # several slaves answered, with different numbers
            return Check.OTHERWISE, None
        if numbers is None:
            return Check.SILENT, node_id
        return (Check.CONFIRMED if numbers == address else Check.OTHERWISE), node_id


# -- The binary tree of all LSS addresses, and fast scan (CiA 305) as a request for one of its branches ----------------
#
# Theory of operation
# The four numbers form 128 bits. A ``Branch`` contains all addresses that begin with the same bits. A slave answers for a branch
# of the part ``LSSSub`` only if it has confirmed the numbers of the parts before since the last reset of the scan. ``Questions``
# therefore first advances the slaves to that part, and remembers which numbers they have confirmed. No request has ``LSSNext``
# below ``LSSSub``, so no slave is switched to *configuration*.


PART_BITS = 32
DEPTH = 4 * PART_BITS


@dataclass(frozen=True, slots=True)
class Branch:
    """All addresses whose first ``depth`` bits are those of ``bits``, a number of 128 bits that begins with the vendor-ID."""

    bits: int = 0
    depth: int = 0

    @property
    def children(self) -> tuple[Branch, Branch]:
        """The two halves, the lower addresses first."""
        depth = self.depth + 1
        return Branch(self.bits, depth), Branch(self.bits | 1 << DEPTH - depth, depth)

    @property
    def numbers(self) -> tuple[int, ...]:
        """The four numbers of the lowest address."""
        return tuple(self.bits >> DEPTH - PART_BITS * (part + 1) & 0xFFFF_FFFF for part in range(4))

    @property
    def sub(self) -> int:
        """Index of the part that contains the last bit."""
        return max(0, self.depth - 1) // PART_BITS

    @property
    def bit_check(self) -> int:
        """The last bit to be compared in that part."""
        return PART_BITS * (self.sub + 1) - self.depth

    @property
    def address(self) -> LssAddress:
        """The lowest address; the only one if the branch is a leaf."""
        return LssAddress(*self.numbers)

    def holds(self, address: LssAddress) -> bool:
        """Whether the branch contains an address."""
        return not (of(address).bits ^ self.bits) >> DEPTH - self.depth

    def within(self, parts: Iterable[int | None]) -> bool:
        """Whether the branch can contain an address with these numbers (None: any)."""
        for part, (own, wanted) in enumerate(zip(self.numbers, parts, strict=True)):
            free = min(PART_BITS, max(0, PART_BITS * (part + 1) - self.depth))
            if wanted is not None and (own ^ wanted) >> free:
                return False
        return True

    def with_part(self, number: int) -> Branch:
        """Return the branch below whose next part is ``number``; this branch must end at the end of a part."""
        depth = self.depth + PART_BITS
        return Branch(self.bits | number << DEPTH - depth, depth)


ROOT = Branch()


def of(address: LssAddress) -> Branch:
    """Return the leaf of an address."""
    bits = 0
    for part in address.parts:
        bits = bits << PART_BITS | part
    return Branch(bits, DEPTH)


class Questions:
    """Sends requests for branches; holds the numbers that the slaves have confirmed since the last reset (None: unknown)."""

    def __init__(self, pace: AdaptiveLssTimeout, found: Callable[[], int]) -> None:
        """``found`` returns the number of slaves found so far, for the display of progress."""
        self._pace = pace
        self._found = found
        self._at: tuple[int, ...] | None = None

    def forget(self) -> None:
        """Begin the next request with a reset, because slaves were switched or contradicted themselves."""
        self._at = None

    def anybody(self, branch: Branch, wait: float | None = None) -> Dialogue[int]:
        """Return the number of answers for a branch of depth 1 or more."""
        if not (yield from self._go(branch.numbers[: branch.sub])):
            return 0
        sub = branch.sub
        frame = fastscan(branch.numbers[sub], branch.bit_check, sub, sub)
        heard = yield from ask(self._pace, frame, wait, found=self._found(), bits=branch.depth)
        return len(heard.answers)

    def anybody_at_last(self, branch: Branch) -> Dialogue[int]:
        """Repeat ``anybody``, each time after a reset, until a slave answers or all tries are used."""
        for _ in range(self._pace.timing.tries):
            self.forget()
            count = yield from self.anybody(branch)
            if count:
                return count
        return 0

    def _go(self, numbers: tuple[int, ...]) -> Dialogue[bool]:
        """Advance the slaves with these numbers to the following part; return whether there are any."""
        for _ in range(self._pace.timing.tries):
            if self._at is None or self._at != numbers[: len(self._at)]:
                yield from self._reset()
            if (yield from self._confirm(numbers)):
                return True
        return False

    def _confirm(self, numbers: tuple[int, ...]) -> Dialogue[bool]:
        assert self._at is not None
        for sub in range(len(self._at), len(numbers)):
            heard = yield from ask(
                self._pace,
                fastscan(numbers[sub], 0, sub, sub + 1),
                found=self._found(),
                bits=DEPTH // 4 * (sub + 1),
            )
            # Slaves whose answer was lost have advanced, and no longer answer for this number.
            if not heard.answers:
                self.forget()
                return False
        self._at = numbers
        return True

    def _reset(self) -> Dialogue[None]:
        for _ in range(self._pace.timing.tries):
            heard = yield from ask(self._pace, fastscan(0, ALL_BITS, 0, 0), found=self._found())
            if heard.answers:
                break
        self._at = ()
