"""The command that runs on one axis: begun, joined by another that asks for the same, and ended, each exactly once."""

from __future__ import annotations

from axisbus.errors import AxisbusError, DriveError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.command_status import CommandStatus, Status, end_as
from axisbus.motion.moves.activity import Activity
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.superimposed.addition import Addition


class ActiveCommand:
    """Holds the activity and its ticket (None: nothing runs), and the set-point handshake that an interrupted move has begun.

    An activity without a ticket has ended well and goes on moving the axis.
    """

    __slots__ = ("activity", "addition", "addition_ticket", "ended", "set_point", "ticket")

    def __init__(self) -> None:
        self.activity: Activity | None = None
        self.ticket: CommandStatus | None = None
        self.set_point: SetPoint | None = None
        self.addition: Addition | None = None  # what is laid over the activity, a path
        self.addition_ticket: CommandStatus | None = None
        self.ended = False  # whether a ticket of the axis has ended since somebody looked and set it back

    def begin(self, activity: Activity, ticket: CommandStatus) -> None:
        """Let ``activity`` run; what ran before must have been dropped."""
        self.activity, self.ticket = activity, ticket
        if isinstance(activity, PositionMove):
            self.set_point = None  # it goes on with the handshake by itself
        ticket.begin()

    def join(self, ticket: CommandStatus) -> None:
        """Let ``ticket`` end as the running command does: the same has been asked for again."""
        running = self.ticket
        assert running is not None
        ticket.begin()
        running.then(lambda: self.finish(ticket, running.error))

    def pass_on(self, ticket: CommandStatus) -> None:
        """Let what runs end with ``ticket``; the one before it ends on the way."""
        assert self.ticket is not None
        self.ticket.then(self._note_end)
        self.ticket = ticket

    def _note_end(self) -> None:
        self.ended = True

    def drop(self, order: CycleOutputs) -> CommandStatus | None:
        """Take the running command away, and return its ticket; a handshake that is under way is kept."""
        if isinstance(self.activity, PositionMove):
            self.set_point = self.activity.in_flight
        if self.activity is not None:
            self.activity.cancel(order)
        ticket, self.activity, self.ticket = self.ticket, None, None
        return ticket

    def lay_over(self, addition: Addition, ticket: CommandStatus) -> None:
        """Let ``ticket`` end with ``addition``; the one before must have been taken away."""
        self.addition, self.addition_ticket = addition, ticket
        ticket.begin()

    def take_addition(self) -> CommandStatus | None:
        """Forget what is laid over the activity; return its ticket."""
        ticket, self.addition, self.addition_ticket = self.addition_ticket, None, None
        return ticket

    def finish(self, ticket: CommandStatus, error: AxisbusError | None = None) -> None:
        """End a ticket, well (no error) or with the reason."""
        if ticket.busy:
            ticket.finish(Status.DONE if error is None else end_as(error), error)
            self.ended = True

    def finish_handshake(self, image: AxisImage, order: CycleOutputs) -> None:
        """Let a set-point handshake that was under way, if any, come to its end."""
        if self.set_point is None:
            return
        try:
            taken = self.set_point.step(image, order)
        except DriveError:
            taken = True  # the next move will find bit 12 as it is, and say so
        if taken:
            self.set_point = None
