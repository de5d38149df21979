"""The way to a drive that PDOs do not reach: its controlword by SDO, and its statusword read back by SDO."""

from __future__ import annotations

from axisbus.cia402 import objects
from axisbus.cia402.state import State, decode
from axisbus.motion.image import Image
from axisbus.motion.order import Order
from axisbus.motion.parameters import AxisParameters

_POLL = 0.1  # seconds between two looks
_SAME = 2  # increments that a standing axis may wander between them


class SdoPath:
    """A stop by SDO, for a node that is not operational, sends no statusword, or no longer gets SYNC.

    Holds the word that was sent, the look that is under way, and what was seen: ``state`` is None until the drive has answered,
    ``stands`` tells that two positions in a row were the same.
    """

    __slots__ = ("_asked", "_due", "_has_position", "_position", "_sent", "stands", "state")

    def __init__(self, parameters: AxisParameters) -> None:
        self.state: State | None = None
        self.stands = False
        self._has_position = parameters.has(objects.POSITION_ACTUAL)
        self._position: int | None = None
        self._sent: int | None = None
        self._asked: dict[int, int] = {}  # request -> index
        self._due = 0.0

    @property
    def may_turn(self) -> bool:
        """Whether the drive has a position, and two of them in a row were not yet the same."""
        return self._has_position and not self.stands

    def look(self, image: Image, order: Order) -> None:
        """Read statusword and position where no PDO brings them."""
        if image.state is not State.UNKNOWN:
            self.state, self.stands, self._position = None, False, None
            return
        for request in [number for number in self._asked if number in image.replies]:
            self._take(self._asked.pop(request), image.replies[request].value)
        if not self._asked and image.now >= self._due:
            self._due = image.now + _POLL
            wanted = [objects.STATUSWORD] + [objects.POSITION_ACTUAL] * self._has_position
            self._asked = {order.request(index, 0, None): index for index in wanted}

    def _take(self, index: int, value: int | None) -> None:
        if index == objects.STATUSWORD:
            self.state = None if value is None else decode(value)
            return
        before, self._position = self._position, value
        self.stands = before is not None and value is not None and abs(value - before) <= _SAME

    def send(self, word: int, image: Image, order: Order) -> None:
        """Send a controlword, once, where no PDO is sure to bring it."""
        if (not image.operational or image.state is State.UNKNOWN) and word != self._sent:
            self._sent = word
            order.request(objects.CONTROLWORD, 0, word)

    def cancel(self, order: Order) -> None:
        """Take back the look that is under way."""
        order.cancel.extend(self._asked)
        self._asked = {}
