"""Commands that wait until the axis is seen at standstill, without commanding any motion."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.errors import AxisbusError, StateError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.standstill import StandstillCheck


class RestWait:
    """One command that takes effect at standstill; holds its standstill check and its deadline.

    Both begin with the first step, so that a path along which the axis is still braking comes before.
    """

    __slots__ = ("_deadline", "_parameters", "_standing", "then", "ticket")

    def __init__(self, parameters: AxisParameters, ticket: CommandStatus, then: Callable[[], None]) -> None:
        """``then`` is called once the axis is at standstill."""
        self._parameters = parameters
        self._standing: StandstillCheck | None = None
        self._deadline = 0.0
        self.ticket = ticket
        self.then = then

    def step(self, image: AxisImage) -> bool:
        """Return True once the axis is seen at standstill.

        Raises:
            StateError: the axis continues to move.
        """
        if self._standing is None:
            self._standing = StandstillCheck(self._parameters, image.now)
            self._deadline = image.now + self._parameters.timing.transition
        if self._standing.seen(image):
            return True
        if image.now > self._deadline:
            raise StateError(
                f"{self.ticket.name}: the axis is not at standstill",
                observed=self._standing.why_not(image),
                remedy="wait until it is at standstill; an axis that is turned by hand or by its load counts as moving, too",
            )
        return False


class StandstillWaiters:
    """The commands of one axis that wait for its standstill, in ``waiting``."""

    __slots__ = ("_parameters", "waiting")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self.waiting: list[RestWait] = []

    def add(self, ticket: CommandStatus, then: Callable[[], None]) -> None:
        """Call ``then`` once the axis is at standstill; the ticket ends after that."""
        self.waiting.append(RestWait(self._parameters, ticket, then))
        ticket.begin()

    def step(self, image: AxisImage, finish: Callable[[CommandStatus, AxisbusError | None], None]) -> None:
        """Call the functions that may be called in this cycle; ``finish`` ends a ticket."""
        for waiting in list(self.waiting):
            try:
                if not waiting.step(image):
                    continue
                waiting.then()
                finish(waiting.ticket, None)
            except AxisbusError as error:
                finish(waiting.ticket, error)
            self.waiting.remove(waiting)

    def drop(self) -> list[CommandStatus]:
        """Discard all waiting commands; return their tickets."""
        tickets, self.waiting = [waiting.ticket for waiting in self.waiting], []
        return tickets
