"""LSS fast scan beside slaves that go on answering it after they were found: each is excluded by its address.

Theory of operation
-------------------
CiA 305 has fast scan answered in *waiting* only; a slave that was found is in *configuration* and silent. Some go on answering, so
that the usual search finds them again and again. Answers carry no address: what a slave that answers on says cannot be told from
what others say, except in branches of the tree of addresses that it is not in. So:

* every slave found is put aside by selective switching, alone, and asked once more by its own address. Who is silent then is out of
  the way. Who answers is *excluded*: its numbers are read from it, and it stays in *waiting*, where it answers by its address.
* the tree is walked from its root. Of a branch that holds somebody excluded both halves are looked at; one that holds nobody
  excluded is asked for. Silence closes it; an answer can only be somebody else's, who is then searched for in this branch.
* silence may be a lost frame, so the walk ends when it has gone through the whole tree ``WALKS`` times without finding anybody.

What cannot be told is said: whether somebody has the same address as one that is excluded (LSS has no means), and that the search
was given up, where addresses go on being answered for that nobody can be selected by.
"""

from __future__ import annotations

from collections.abc import Sequence

from axisbus.cia305.dialogue import AdaptiveLssTimeout, Dialogue, all_waiting, say, select
from axisbus.cia305.master import numbers_of
from axisbus.cia305.scan_result import Check, KnownIdentity, Scanned, Unconfigured
from axisbus.cia305.services import LssAddress, LssState, switch_global
from axisbus.cia305.tree import DEPTH, PART_BITS, ROOT, Branch, Questions, of
from axisbus.errors import LssError

WALKS = 2  # through the whole tree, with nobody found
RESTARTS = 6  # searches in one branch, each more patient than the last
MOST_DOUBTFUL = 3  # addresses that are answered for and cannot be selected

GIVEN_UP = (
    f"more than {MOST_DOUBTFUL} addresses are answered for that nobody can be selected by: most likely a slave answers "
    "fast scan whatever it is asked for, and hides the others; disconnect it to find them"
)
CONTRADICTED = "answers contradicted each other in the range from {low} to {high}: somebody there may not have been found"


class _NobodyError(Exception):
    """Somebody answered for a branch, and nobody for either half of it; never leaves this module."""


class _OthersError(Exception):
    """Those who answered for a branch are not as ``KnownIdentity`` says; never leaves this module."""


class ExcludingScan:
    """The rest of a scan; holds who is put aside in *configuration*, who is excluded, and which branches are still open."""

    def __init__(
        self, pace: AdaptiveLssTimeout, known: KnownIdentity, most: int, found: Sequence[Unconfigured]
    ) -> None:
        """``found`` are those that the usual search found, each of whom is checked first; at most ``most`` are found in all."""
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
        """Find them all; those put aside are in *configuration* at the end, those excluded in *waiting*."""
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
        """Go through all branches once; a branch in which somebody was found is looked at again."""
        yield from self._put_aside()
        self._open = [ROOT]
        while self._open and not self._is_over():
            branch = self._open.pop()
            if branch.depth == 0 or any(branch.holds(slave.address) for slave in self._excluded):
                self._open += reversed(branch.children if branch.depth < DEPTH else ())
            else:
                yield from self._look(branch)

    def _look(self, branch: Branch) -> Dialogue[None]:
        """Ask for a branch that nobody excluded is in."""
        if not branch.within(self._known) and (self._others or self._seen_others):
            return  # those are only mentioned, and one walk is enough for that
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
            else:  # nobody has it, or somebody has come back who was put aside
                self._search_again(branch)

    def _search_again(self, branch: Branch) -> None:
        count = self._searches[branch] = self._searches.get(branch, 0) + 1
        self._questions.forget()
        if count > 1:  # once is an accident
            self._pace.distrust()
        if count < RESTARTS:
            self._open.append(branch)
        else:
            last = Branch(branch.bits | (1 << DEPTH - branch.depth) - 1, DEPTH)
            self._incomplete = CONTRADICTED.format(low=branch.address, high=last.address)

    def _descend(self, branch: Branch) -> Dialogue[Branch]:
        """Return the leaf of somebody in a branch that was answered for, the lowest unless a guess was right."""
        while branch.depth < DEPTH:
            branch = (yield from self._guessed(branch)) or (yield from self._half(branch))
        return branch

    def _guessed(self, branch: Branch) -> Dialogue[Branch | None]:
        """Go down a whole part, if somebody has the number of the last slave found there: often there are several of a kind."""
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
        """Put a slave aside if it lets itself be, else exclude it; an address that nobody has is dropped."""
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
        """Have those in *configuration* who are silent there, and all others in *waiting*."""
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
        """Read the numbers and the node-ID of a slave that is alone in *configuration*."""
        if not selectable:
            return Check.UNSELECTABLE, None
        for _ in range(self._pace.timing.tries):
            yield from all_waiting(self._pace)
            yield from say(
                self._pace, switch_global(LssState.WAITING), self._pace.patience
            )  # what is late may come
            if (yield from select(self._pace, address)):
                break
        try:
            numbers, node_id = yield from numbers_of(self._pace, address)
        except LssError:  # several answered, and not the same
            return Check.OTHERWISE, None
        if numbers is None:
            return Check.SILENT, node_id
        return (Check.CONFIRMED if numbers == address else Check.OTHERWISE), node_id
