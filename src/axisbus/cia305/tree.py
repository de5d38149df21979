"""The binary tree of all LSS addresses, and fast scan (CiA 305) as a request for one of its branches.

Theory of operation
-------------------
The four numbers form 128 bits. A ``Branch`` contains all addresses that begin with the same bits. A slave answers for a branch of
the part ``LSSSub`` only if it has confirmed the numbers of the parts before since the last reset of the scan. ``Questions``
therefore first advances the slaves to that part, and remembers which numbers they have confirmed. No request has ``LSSNext`` below
``LSSSub``, so no slave is switched to *configuration*.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from axisbus.cia305.dialogue import AdaptiveLssTimeout, Dialogue, ask
from axisbus.cia305.services import ALL_BITS, LssAddress, fastscan

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
