"""A beam that moves at a velocity until another command comes, on a line whose end is far away."""

from __future__ import annotations

from axisbus.errors import AxisbusError, LimitError, Replaced
from axisbus.motion.command_status import CommandStatus, Status, end_as
from axisbus.motion.group.path_motion import PathMotion

_REACHED = 1e-6  # of the velocity


class GantryVelocityMove:
    """Holds the ticket of the velocity command, which is done at that velocity, and the ticket of the line, which continues."""

    def __init__(
        self, velocity: float, ticket: CommandStatus, inner: CommandStatus, line: PathMotion | None
    ) -> None:
        """``velocity`` signed, in unit/s; ``inner``: the ticket of ``line`` (None if the line has not begun)."""
        self._velocity = velocity
        self._ticket, self._inner, self._line = ticket, inner, line
        ticket.begin()

    @property
    def name(self) -> str:
        """The name of the command."""
        return self._ticket.name

    @property
    def over(self) -> bool:
        """Whether the line has ended."""
        return not self._inner.busy

    def abandon(self, error: AxisbusError) -> None:
        """End the ticket with ``error``."""
        self._ticket.finish(Status.ERROR, error)

    def change(self, velocity: float, ticket: CommandStatus) -> bool:
        """Change the velocity in the same direction, with the same acceleration; return False if that is impossible."""
        line = self._line
        if (
            self.over
            or line is None
            or not line.planned
            or line.travel.braking
            or velocity * self._velocity <= 0.0
        ):
            return False
        self._end_for(ticket.name)
        line.travel.velocity *= velocity / self._velocity
        self._velocity, self._ticket = velocity, ticket
        ticket.begin()
        return True

    def make_way(self, name: str) -> None:
        """End a ticket that is still open: with the line's result if the line has ended, else as replaced by command ``name``."""
        self.step()
        self._end_for(name)

    def step(self) -> bool:
        """Once per cycle: end the ticket if the velocity is reached or the line has ended; return whether it ended."""
        if not self._ticket.busy:
            return False
        line = self._line
        if self.over:
            error = self._inner.error or self._too_short()
            self._ticket.finish(end_as(error), error)
        elif line is not None and line.planned and line.travel.factor > 0.0:
            wanted = line.travel.velocity * line.travel.factor
            if abs(line.travel.speed - wanted) <= _REACHED * wanted or self._as_fast_as_it_may(line, wanted):
                self._ticket.finish(Status.DONE)
        return not self._ticket.busy

    def _end_for(self, name: str) -> None:
        self._ticket.finish(Status.ABORTED, Replaced(f"{self.name} was replaced by {name}"))

    def _as_fast_as_it_may(self, line: PathMotion, wanted: float) -> bool:
        return wanted > line.top >= line.travel.speed >= (1.0 - _REACHED) * line.top

    def _too_short(self) -> LimitError:
        return LimitError(
            f"{self.name}: the beam stopped at its position limit before it reached the velocity",
            remedy="begin farther away from the limit, or command less velocity or more acceleration",
        )
