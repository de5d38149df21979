"""The running command of one axis: it begins once, further tickets for the same command may join, and it ends once."""

from __future__ import annotations

from axisbus.errors import AxisbusError, DriveError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.command_status import CommandStatus, Status, end_as
from axisbus.motion.moves.activity import Activity
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.superimposed import Addition


class ActiveCommand:
    """Holds the activity and its ticket (None: no command runs), and an unfinished set-point handshake of an interrupted move.

    An activity without a ticket has completed its command and continues to move the axis.
    """

    __slots__ = ("activity", "addition", "addition_ticket", "ended", "set_point", "ticket")

    def __init__(self) -> None:
        self.activity: Activity | None = None
        self.ticket: CommandStatus | None = None
        self.set_point: SetPoint | None = None
        self.addition: Addition | None = None  # the distance superimposed on the activity, a path
        self.addition_ticket: CommandStatus | None = None
        # Whether a ticket of the axis has ended since the flag was last reset by its reader.
        self.ended = False

    def begin(self, activity: Activity, ticket: CommandStatus) -> None:
        """Run ``activity``; the caller must have dropped the previous activity before."""
        self.activity, self.ticket = activity, ticket
        if isinstance(activity, PositionMove):
            self.set_point = None  # the new move continues the handshake
        ticket.begin()

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished set-point handshake of the activity, else of an interrupted move."""
        return (None if self.activity is None else self.activity.in_flight) or self.set_point

    def join(self, ticket: CommandStatus) -> None:
        """Let ``ticket`` end with the running command: the same command was requested again."""
        running = self.ticket
        assert running is not None
        ticket.begin()
        running.then(lambda: self.finish(ticket, running.error))

    def pass_on(self, ticket: CommandStatus) -> None:
        """Let the running activity end with ``ticket``; the previous ticket ends on the way."""
        assert self.ticket is not None
        self.ticket.then(self._note_end)
        self.ticket = ticket

    def _note_end(self) -> None:
        self.ended = True

    def drop(self, order: CycleOutputs) -> CommandStatus | None:
        """Remove the running command, and return its ticket; an unfinished handshake remains in ``set_point``."""
        if self.activity is not None:
            self.set_point = self.in_flight
            self.activity.cancel(order)
        ticket, self.activity, self.ticket = self.ticket, None, None
        return ticket

    def superimpose(self, addition: Addition, ticket: CommandStatus) -> None:
        """Let ``ticket`` end with ``addition``; the caller must have removed the previous superimposed distance before."""
        self.addition, self.addition_ticket = addition, ticket
        ticket.begin()

    def take_addition(self) -> CommandStatus | None:
        """Discard the superimposed distance; return its ticket."""
        ticket, self.addition, self.addition_ticket = self.addition_ticket, None, None
        return ticket

    def finish(self, ticket: CommandStatus, error: AxisbusError | None = None) -> None:
        """End a ticket, successfully (no error) or with the reason."""
        if ticket.busy:
            ticket.finish(Status.DONE if error is None else end_as(error), error)
            self.ended = True

    def finish_handshake(self, image: AxisImage, order: CycleOutputs) -> None:
        """Continue an unfinished set-point handshake, if any, until it ends."""
        if self.set_point is None:
            return
        try:
            taken = self.set_point.step(image, order)
        except DriveError:
            taken = True  # the next move will find bit 12 unchanged, and report it
        if taken:
            self.set_point = None
