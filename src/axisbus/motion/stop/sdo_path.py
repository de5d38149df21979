"""The way to a drive that PDOs do not reach: its controlword by SDO, and its statusword read back by SDO."""

from __future__ import annotations

from axisbus.cia402 import objects
from axisbus.cia402.state import ENERGISED, State, decode
from axisbus.motion.axis.image import Image
from axisbus.motion.axis.order import Order
from axisbus.motion.parameters import AxisParameters
from axisbus.units import unwrap

_POLL = 0.1  # seconds between two looks
_SAME = 2  # increments that a standing axis may wander between them
_LED = (objects.MODES_OF_OPERATION_DISPLAY, objects.POSITION_DEMAND)


class SdoPath:
    """A stop by SDO, for a node that is not operational, sends no statusword, or no longer gets SYNC.

    Holds the word that was sent, the look that is under way, and what was seen: ``state`` is None until the drive has answered,
    ``stands`` tells that two positions in a row were the same, and that the drive's demand does not pull it elsewhere.
    """

    __slots__ = (
        "_asked",
        "_due",
        "_has_position",
        "_led",
        "_position",
        "_rests",
        "_seen",
        "_sent",
        "_window",
        "stands",
        "state",
    )

    def __init__(self, parameters: AxisParameters) -> None:
        self.state: State | None = None
        self.stands = False
        self._rests = False  # as far as two positions tell
        self._has_position = parameters.has(objects.POSITION_ACTUAL)
        self._led = _LED if all(map(parameters.has, _LED)) else ()
        self._window = parameters.pull_window
        self._position: int | None = None
        self._sent: int | None = None
        self._asked: dict[int, int] = {}  # request -> index
        self._seen: dict[int, int | None] = {}  # index -> value, of this look
        self._due = 0.0

    @property
    def may_turn(self) -> bool:
        """Whether the drive has a position, and two of them in a row were not yet the same."""
        return self._has_position and not self._rests

    def look(self, image: Image, order: Order) -> None:
        """Read statusword and position where no PDO brings them, and what leads a drive that is energised."""
        if image.state is not State.UNKNOWN:
            self.state, self.stands, self._rests, self._position = None, False, False, None
            return
        for request in [number for number in self._asked if number in image.replies]:
            self._take(self._asked.pop(request), image.replies[request].value)
            if not self._asked:
                self._judge(image)
        if not self._asked and image.now >= self._due:
            self._due = image.now + _POLL
            self._ask(order)

    def _ask(self, order: Order) -> None:
        wanted = [objects.STATUSWORD]
        if self._has_position:
            wanted.append(objects.POSITION_ACTUAL)
            wanted += self._led if self.state in ENERGISED else ()
        self._seen = {}
        self._asked = {order.request(index, 0, None): index for index in wanted}

    def _take(self, index: int, value: int | None) -> None:
        self._seen[index] = value
        if index == objects.STATUSWORD:
            self.state = None if value is None else decode(value)

    def _judge(self, image: Image) -> None:
        """All of a look has come."""
        before, now = self._position, self._seen.get(objects.POSITION_ACTUAL)
        self._position = now
        self._rests = before is not None and now is not None and abs(now - before) <= _SAME
        self.stands = self._rests and not self._is_pulled(image)

    def _is_pulled(self, image: Image) -> bool:
        demand, mode = (self._seen.get(index) for index in reversed(_LED))
        if self._position is None or demand is None or not image.led.trust.believes(mode):
            return False
        position = unwrap(image.last_position, self._position)
        demand = unwrap(position, demand)
        lead = demand - position if image.led.counts(demand, mode) else None
        pull = image.led.pull(lead, position, self.state or State.UNKNOWN)
        return pull is not None and abs(pull) > self._window

    def send(self, word: int, image: Image, order: Order) -> None:
        """Send a controlword, once, where no PDO is sure to bring it."""
        if (not image.operational or image.state is State.UNKNOWN) and word != self._sent:
            self._sent = word
            order.request(objects.CONTROLWORD, 0, word)

    def cancel(self, order: Order) -> None:
        """Take back the look that is under way."""
        order.cancel.extend(self._asked)
        self._asked = {}
