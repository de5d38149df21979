"""A module's error words: requested one after the other when a heartbeat reports a fault; as error code and as sentences."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple import error_query
from axisbus.drives.gim6010.can_simple.codec import Outgoing, Unexpected
from axisbus.drives.gim6010.can_simple.error_query import ErrorType

WAIT = 0.05  # s
_OBJECT = 0x2F00  # defined by axisbus, in the manufacturer-specific range: sub-index by category, low and high 32 bits
AXIS = "axis"
# Categories of 2F00h: first sub-index, and whether the next sub-index contains high bits.
_PLACES = {
    AXIS: (1, False),
    "motor": (2, True),
    "encoder": (4, False),
    "controller": (5, False),
    "system": (6, False),
}
_MISSING = 7  # sub-index: a bit for each category that was not answered, in the order of ``_PLACES``
ADDRESSES = tuple((_OBJECT, subindex) for subindex in range(1, _MISSING + 1))
# The axis's word only summarises the others: it is the least specific.
_ORDER = ("system", "motor", "encoder", "controller", AXIS)
_GENERIC = 0x1000


class ModuleErrors:
    """The error words of one fault: the axis's word from the heartbeat, the others from their answers."""

    def __init__(self, node: int, wait: float = WAIT) -> None:
        """``wait`` (s) is the time-out of each answer; owners reported modules that do not answer."""
        self._node = node
        self._wait = wait
        self.words: dict[str, int | None] = {}
        self._left: list[ErrorType] = []
        self._asked: ErrorType | None = None
        self._until = 0.0

    def begin(self, axis_error: int) -> None:
        """Begin a fault: request all error words."""
        self.words = {AXIS: axis_error}
        self._left, self._asked = list(ErrorType), None

    def note(self, axis_error: int) -> None:
        """Store the axis's word of a further heartbeat."""
        self.words[AXIS] = axis_error

    def clear(self) -> None:
        self.words, self._left, self._asked = {}, [], None

    @property
    def told(self) -> bool:
        """Whether no further answer is expected."""
        return not self._left and self._asked is None

    @property
    def unanswered(self) -> bool:
        """Whether all words were requested and none was answered: this firmware does not support Get_Error."""
        others = [word for name, word in self.words.items() if name != AXIS]
        return self.told and bool(others) and not any(word is not None for word in others)

    def ask(self, now: float) -> Outgoing | None:
        if self._asked is not None and now >= self._until:
            self.words[self._asked.category] = None
            self._asked = None
        if self._asked is not None or not self._left:
            return None
        self._asked, self._until = self._left.pop(0), now + self._wait
        return error_query.request(self._node, self._asked)

    def take(self, data: bytes) -> None:
        """Take an answer to Get_Error, which does not name the requested word."""
        if self._asked is None:
            return  # sent cyclically: its category is unknown
        word = error_query.read(self._node, data, self._asked)
        if not isinstance(word, Unexpected):
            self.words[self._asked.category] = word
            self._asked = None

    @property
    def _first(self) -> faults.GimFault | None:
        for category in _ORDER:
            word = self.words.get(category) or 0
            for fault in faults.FAULTS:
                if fault.category == category and fault.bits & word:
                    return fault
        return None

    @property
    def code(self) -> int:
        """603Fh: the code of the most specific known bit; 0 without a fault."""
        if not self.words:
            return 0
        return _GENERIC if self._first is None else self._first.code or faults.SEE_BITS

    @property
    def register(self) -> int:
        """1001h: bit 0, and the bit that belongs to the code."""
        bit = None if self._first is None else self._first.register_bit
        return 0 if not self.words else 1 if bit is None else 1 | 1 << bit

    def value(self, subindex: int) -> int | None:
        """Return an entry of 2F00h; None if it does not exist."""
        for category, (first, wide) in _PLACES.items():
            if subindex in (first, first + wide):
                return (self.words.get(category) or 0) >> 32 * (subindex - first) & 0xFFFF_FFFF
        return self._missing if subindex == _MISSING else None

    @property
    def _missing(self) -> int:
        return sum(
            1 << place
            for place, name in enumerate(_PLACES)
            if name in self.words and self.words[name] is None
        )


def explain(_code: int, details: Mapping[tuple[int, int], int]) -> list[str]:
    """Return a sentence for each bit of 2F00h, and the names of the words that the module did not report."""
    texts = [text for category in _PLACES for text in faults.words(category, _word(category, details))]
    missing = details.get((_OBJECT, _MISSING), 0)
    unknown = [name for place, name in enumerate(_PLACES) if missing >> place & 1]
    if unknown:
        texts.append(f"the error words of {', '.join(unknown)} are not answered by this firmware (Get_Error)")
    return texts


def _word(category: str, details: Mapping[tuple[int, int], int]) -> int:
    first, wide = _PLACES[category]
    high = details.get((_OBJECT, first + 1), 0) if wide else 0
    return details.get((_OBJECT, first), 0) | high << 32
