"""The command that runs on one axis: begun, joined by another that asks for the same, and ended, each exactly once."""

from __future__ import annotations

from axisbus.errors import AxisbusError, DriveError
from axisbus.motion.axis.image import Image
from axisbus.motion.axis.order import Order
from axisbus.motion.handle import Handle, Status, end_as
from axisbus.motion.moves.activity import Activity
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.moves.setpoint import SetPoint


class Running:
    """Holds the activity and its handle (None: nothing runs), and the set-point handshake that an interrupted move has begun.

    An activity without a handle has ended well and goes on moving the axis. ``has_ended``: one has, since the scan last looked.
    """

    __slots__ = ("activity", "handle", "has_ended", "set_point")

    def __init__(self) -> None:
        self.activity: Activity | None = None
        self.handle: Handle | None = None
        self.set_point: SetPoint | None = None
        self.has_ended = False

    def begin(self, activity: Activity, handle: Handle) -> None:
        """Let ``activity`` run; what ran before must have been dropped."""
        self.activity, self.handle = activity, handle
        handle.status = Status.ACTIVE

    def join(self, handle: Handle) -> None:
        """Let ``handle`` end as the running command does: the same has been asked for again."""
        running = self.handle
        assert running is not None
        handle.status = Status.ACTIVE
        running.add_done_callback(lambda: self.finish(handle, running.error))

    def drop(self, order: Order) -> Handle | None:
        """Take the running command away, and return its handle; a handshake that is under way is kept."""
        if isinstance(self.activity, PositionMove):
            self.set_point = self.activity.in_flight
        if self.activity is not None:
            self.activity.cancel(order)
        handle, self.activity, self.handle = self.handle, None, None
        return handle

    def finish(self, handle: Handle, error: AxisbusError | None = None) -> None:
        """End a handle, well (no error) or with the reason."""
        if handle.busy:
            handle.finish(Status.DONE if error is None else end_as(error), error)
            self.has_ended = True

    def finish_handshake(self, image: Image, order: Order) -> None:
        """Let a set-point handshake that was under way, if any, come to its end."""
        if self.set_point is None:
            return
        try:
            taken = self.set_point.step(image, order)
        except DriveError:
            taken = True  # the next move will find bit 12 as it is, and say so
        if taken:
            self.set_point = None
