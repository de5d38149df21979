"""One SDO transfer after the other, each repeated if no answer comes."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.cia301 import abort
from axisbus.cia402.port import SdoReply
from axisbus.errors import DriveError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import object_text
from axisbus.motion.parameters import AxisParameters

_TRIES = 3  # transfers may be repeated safely: they read, or write a fixed value

Value = Callable[[], int]


class SdoExchange:
    """Holds the active transfer, if any."""

    __slots__ = ("_deadline", "_id", "_index", "_name", "_timeout", "_tries", "_value", "is_active")

    def __init__(self, parameters: AxisParameters) -> None:
        self._name, self._timeout = parameters.name, parameters.timing.sdo
        self.is_active = False
        self._id: int | None = None
        self._index = 0
        self._value: Value | None = None
        self._tries = 0
        self._deadline = 0.0

    def begin(self, index: int, value: Value | None, image: AxisImage, order: CycleOutputs) -> None:
        """Begin a transfer; ``value`` returns the value to write at the time of sending (None: read)."""
        self._index, self._value, self._tries = index, value, 0
        self._send(image, order)

    def step(self, image: AxisImage, order: CycleOutputs) -> SdoReply | None:
        """Return the answer of the active transfer when it has come.

        Raises:
            DriveError: the drive aborts the transfer, or does not answer.
        """
        reply = image.replies.get(self._id) if self._id is not None else None
        if reply is None:
            if image.now > self._deadline:
                self._retry(image, order)
            return None
        if reply.abort == abort.TIMED_OUT:
            self._retry(image, order)
            return None
        self._id, self.is_active = None, False
        if reply.abort is not None:
            raise self._refused_error(reply.abort)
        return reply

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the active transfer; an answer that comes nevertheless is ignored."""
        if self._id is not None:
            order.cancel.append(self._id)
        self._id, self.is_active = None, False

    def _retry(self, image: AxisImage, order: CycleOutputs) -> None:
        self.cancel(order)
        if self._tries >= _TRIES:
            raise DriveError(
                f"{self._name}: {object_text(self._index)}: the drive has not answered {_TRIES} SDO requests",
                axis=self._name,
                remedy="check cable and bus load; a drive that is busy storing parameters answers late",
            )
        self._send(image, order)

    def _send(self, image: AxisImage, order: CycleOutputs) -> None:
        self._tries += 1
        self._deadline = image.now + self._timeout
        self._id = order.request(self._index, 0, None if self._value is None else self._value())
        self.is_active = True

    def _refused_error(self, code: int) -> DriveError:
        refused = (
            "does not allow it to be read" if self._value is None else f"does not accept {self._value():04X}h"
        )
        return DriveError(
            f"{self._name}: {object_text(self._index)}: the drive {refused}",
            axis=self._name,
            observed=f"abort code {abort.describe(code)}",
            remedy="see in the drive's manual which functions its touch probe has, and when it accepts them",
        )
