"""Reach a drive that PDOs do not reach: send its controlword by SDO, and read its statusword by SDO.

Theory of operation
-------------------
The controlword is sent by SDO if the node is not operational, if the state of the drive is unknown, or if the drive was seen not to
obey the RPDO. It is sent repeatedly until the stop ends, because a word that was refused or lost stops nothing.

After a boot-up message two devices may answer SDO requests under one node-ID, and the one at standstill may answer first. So the
values received by TPDO since then (``AxisImage.since_restart``) can only contradict a stop, never confirm it. A TPDO statusword of
an energised drive has priority over the statusword read by SDO, and a changing TPDO position counts as motion.
"""

from __future__ import annotations

import math

from axisbus.cia402 import objects
from axisbus.cia402.state import ENERGISED, PowerState, decode
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.settled_value import SettledValue
from axisbus.units import unwrap

_POLL = 0.1  # seconds between two reads
_SAME = 2  # increments that an axis at standstill may move between them
_OBEYED_WITHIN = 0.1  # seconds after which a drive still in operation enabled has not obeyed the RPDO
_SEND_AGAIN = 0.25  # seconds
_DEMAND_OBJECTS = (objects.MODES_OF_OPERATION_DISPLAY, objects.POSITION_DEMAND)


class SdoPath:
    """A stop by SDO, for a node that is not operational, sends no statusword, does not obey RPDOs, or no longer gets SYNC.

    Holds the word that was sent, the read that is running, and the values read.
    """

    __slots__ = (
        "_asked",
        "_at_standstill",
        "_demand_objects",
        "_due",
        "_has_position",
        "_position",
        "_rests",
        "_seen",
        "_send_due",
        "_sending",
        "_state",
        "_tpdo_state",
        "_tpdo_still",
        "_window",
        "_word",
        "_word_since",
    )

    def __init__(self, parameters: AxisParameters) -> None:
        self._state: PowerState | None = None
        self._at_standstill = False
        self._rests = False  # as far as two positions show
        self._has_position = parameters.has(objects.POSITION_ACTUAL)
        self._demand_objects = _DEMAND_OBJECTS if all(map(parameters.has, _DEMAND_OBJECTS)) else ()
        self._window = parameters.pull_window
        self._position: int | None = None
        self._tpdo_state: PowerState | None = None
        self._tpdo_still = SettledValue(parameters.standstill_tolerance, parameters.timing.standstill_time)
        self._word: int | None = None
        self._word_since = math.inf
        self._sending: int | None = None  # the request that is running
        self._send_due = -math.inf
        self._asked: dict[int, int] = {}  # request -> index
        self._seen: dict[int, int | None] = {}  # index -> value, of this read
        self._due = 0.0

    @property
    def state(self) -> PowerState | None:
        """The drive's state by SDO; None until it has answered. An energised state shown by TPDOs has priority."""
        if self._state is None or self._tpdo_state is None or self._state in ENERGISED:
            return self._state
        return self._tpdo_state if self._tpdo_state in ENERGISED else self._state

    @property
    def at_standstill(self) -> bool:
        """Whether two consecutive positions were the same, nothing pulls the axis, and no TPDO shows a motion."""
        return self._at_standstill and not self._tpdo_shows_motion

    @property
    def may_turn(self) -> bool:
        """Whether the drive has a position and two consecutive positions were not yet the same, or a TPDO shows a motion."""
        return (self._has_position and not self._rests) or self._tpdo_shows_motion

    @property
    def _tpdo_shows_motion(self) -> bool:
        return self._tpdo_state is not None and not self._tpdo_still.still

    def look(self, image: AxisImage, order: CycleOutputs) -> None:
        """Read statusword and position if no PDO brings them, and mode and demand of an energised drive."""
        if image.state is not PowerState.UNKNOWN:
            self._state, self._at_standstill, self._rests, self._position = None, False, False, None
            self._tpdo_state = None
            return
        self._take_tpdo_values(image)
        for request in [number for number in self._asked if number in image.replies]:
            self._take(self._asked.pop(request), image.replies[request].value)
            if not self._asked:
                self._judge(image)
        if not self._asked and image.now >= self._due:
            self._due = image.now + _POLL
            self._begin_read(order)

    def _take_tpdo_values(self, image: AxisImage) -> None:
        """Evaluate the TPDO values received since the node may have restarted."""
        word, position = image.since_restart if image.restarted else (None, None)
        self._tpdo_state = None if word is None or position is None else decode(word.value)
        if position is not None:
            self._tpdo_still.feed(position.value, position.stamp)

    def _begin_read(self, order: CycleOutputs) -> None:
        wanted = [objects.STATUSWORD]
        if self._has_position:
            wanted.append(objects.POSITION_ACTUAL)
            wanted += self._demand_objects if self._state in ENERGISED else ()
        self._seen = {}
        self._asked = {order.request(index, 0, None): index for index in wanted}

    def _take(self, index: int, value: int | None) -> None:
        self._seen[index] = value
        if index == objects.STATUSWORD:
            self._state = None if value is None else decode(value)

    def _judge(self, image: AxisImage) -> None:
        """Evaluate a read after its last value has arrived."""
        before, now = self._position, self._seen.get(objects.POSITION_ACTUAL)
        self._position = now
        self._rests = before is not None and now is not None and abs(now - before) <= _SAME
        self._at_standstill = self._rests and not self._is_pulled(image)

    def _is_pulled(self, image: AxisImage) -> bool:
        demand, mode = (self._seen.get(index) for index in reversed(_DEMAND_OBJECTS))
        if self._position is None or demand is None or not image.reference_tracker.trust.trusts(mode):
            return False
        position = unwrap(image.last_position, self._position)
        demand = unwrap(position, demand)
        lead = demand - position if image.reference_tracker.may_count(demand, mode) else None
        pull = image.reference_tracker.pull(lead, position, self._state or PowerState.UNKNOWN)
        return pull is not None and abs(pull) > self._window

    def send(self, word: int, image: AxisImage, order: CycleOutputs) -> None:
        """Send a stop's controlword by SDO if a PDO may not bring it, repeatedly. Must be called in each cycle of the stop."""
        if word != self._word:
            self._word, self._word_since = word, image.now
            self._sending, self._send_due = None, -math.inf
        if self._sending is not None and self._sending in image.replies:
            self._sending = None
        if self._sending is None and image.now >= self._send_due and self._is_needed(image):
            self._send_due = image.now + _SEND_AGAIN
            self._sending = order.request(objects.CONTROLWORD, 0, word)

    def _is_needed(self, image: AxisImage) -> bool:
        if not image.operational or image.state is PowerState.UNKNOWN:
            return True
        return image.state is PowerState.OPERATION_ENABLED and image.now > self._word_since + _OBEYED_WITHIN

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the running read."""
        order.cancel.extend(self._asked)
        self._asked = {}
