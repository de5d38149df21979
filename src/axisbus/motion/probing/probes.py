"""The touch probe of one axis: the requests for its two inputs, each until its input is switched off again."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from axisbus.errors import AxisbusError, Interrupted, NodeError, Replaced, StateError, Stopped
from axisbus.motion.axis.active_command import ActiveCommand
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.commands import Probe, ProbeAbort
from axisbus.motion.moves.activity import require_position
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.probing.arming import Arming, ProbeFunction
from axisbus.motion.stop.diagnosis import boot_and_reset, nmt_text, when_back


@dataclass(slots=True)
class _Request:
    """``ticket``: of the request (None once it has ended); ``abort_tickets``: tickets that wait until the input is switched off."""

    arming: Arming
    ticket: CommandStatus | None = None
    key: int | None = None
    abort_tickets: list[CommandStatus] = field(default_factory=list)


class Probes:
    """Holds the request for each input, and 60B8h, which they share. It neither moves nor energises anything."""

    def __init__(self, parameters: AxisParameters, running: ActiveCommand) -> None:
        """``running`` reports to the scan that a ticket has ended, or has changed."""
        self.requests: dict[int, _Request] = {}
        self._parameters = parameters
        self._running = running
        self._function = ProbeFunction()
        self.latched = 0  # edges that were reported

    def begin(self, command: Probe, ticket: CommandStatus, image: AxisImage, order: CycleOutputs) -> None:
        """Accept a request; an earlier one for the same input ends as replaced.

        Raises:
            StateError: the node is not operational.
            StaleError: the axis position is unknown.
        """
        self._require_node(ticket, image)
        require_position(image, self._parameters.name, "a position that its touch probe latches")
        before = self._replace(command.number, ticket, order)
        arming = self._arming(command.number, command)
        self.requests[command.number] = _Request(arming, ticket, command.key, before)

    def abort(
        self, command: ProbeAbort, ticket: CommandStatus, image: AxisImage, order: CycleOutputs
    ) -> None:
        """Switch an input off, whichever client has armed it; with a ``key``, only if that request has armed it.

        Raises:
            StateError: the node is not operational.
        """
        request = self.requests.get(command.number)
        if command.key is not None and (request is None or request.key != command.key):
            self._running.finish(ticket)  # that request has ended, and another one may have followed
            return
        self._require_node(ticket, image)
        if request is None:
            request = _Request(self._arming(command.number, None))
            self.requests[command.number] = request
        else:
            self._end(request, Stopped(f"{ticket.name} was asked for"))
            request.arming.switch_off(order)
        ticket.begin()
        request.abort_tickets.append(ticket)

    def last_poll_of(self, number: int) -> float:
        """Return when the last poll of an armed input without a new edge began (s); infinite without a request."""
        request = self.requests.get(number)
        return math.inf if request is None else request.arming.last_poll

    def step(self, image: AxisImage, order: CycleOutputs) -> None:
        """Advance each request by one cycle."""
        if not image.operational:
            self.lose(self._lost(image), order)
            return
        for number, request in list(self.requests.items()):
            try:
                self._step(number, request, image, order)
            except AxisbusError as error:
                self._fail(number, request, error, order)

    def end_all(self, kind: type[Interrupted], why: str, order: CycleOutputs, remedy: str = "") -> None:
        """End all requests, and switch their inputs off; ``why`` completes the sentence after the name of each."""
        for request in self.requests.values():
            if request.ticket is not None:
                self._end(request, kind(f"{request.ticket.name} {why}", remedy=remedy))
                request.arming.switch_off(order)

    def lose(self, error: AxisbusError, order: CycleOutputs) -> None:
        """End all requests of a lost node; its inputs stay armed, as the node cannot be reached."""
        for request in self.requests.values():
            request.arming.drop(order)
            self._end(request, error)
            self._end_abort_tickets(request, error)
        self.requests.clear()
        self._function.word = None

    def drop(self) -> list[CommandStatus]:
        """Return the tickets that have not ended, and drop all requests."""
        tickets = [
            ticket
            for request in self.requests.values()
            for ticket in (request.ticket, *request.abort_tickets)
            if ticket
        ]
        self.requests.clear()
        return tickets

    # -- one request -------------------------------------------------------------------------------------------------

    def _arming(self, number: int, command: Probe | None) -> Arming:
        if not self.requests:
            self._function.word = None  # other programs may have written it meanwhile
        return Arming(number, command, self._parameters, self._function)

    def _replace(self, number: int, ticket: CommandStatus, order: CycleOutputs) -> list[CommandStatus]:
        """End the previous request, and return the tickets that wait until its input is switched off; they continue to wait."""
        request = self.requests.get(number)
        if request is None:
            return []
        request.arming.drop(order)
        if request.ticket is not None:
            self._end(request, Replaced(f"{request.ticket.name} was replaced by {ticket.name}"))
        return request.abort_tickets

    def _step(self, number: int, request: _Request, image: AxisImage, order: CycleOutputs) -> None:
        arming, ticket = request.arming, request.ticket
        was_armed = arming.armed
        arming.step(image, order)
        if ticket is not None:
            self._report(request, ticket, became_armed=arming.armed and not was_armed)
            if request.ticket is None:  # all requested edges were reported
                arming.switch_off(order)
        if arming.over or (arming.armed and request.abort_tickets and request.ticket is not None):
            self._end_abort_tickets(request, None)
        if arming.over:
            del self.requests[number]

    def _report(self, request: _Request, ticket: CommandStatus, *, became_armed: bool) -> None:
        if became_armed:
            ticket.begin()
            self._running.ended = True  # wakes clients that wait for it
        for capture in request.arming.captures:
            ticket.report_capture(capture)
            self.latched += 1
            self._running.ended = True
        if request.arming.fulfilled:
            self._end(request, None)

    def _fail(self, number: int, request: _Request, error: AxisbusError, order: CycleOutputs) -> None:
        """Switch the input off after a failure if the drive accepts it; if switching off has failed, drop the request."""
        switching_off = request.ticket is None
        self._end(request, error)
        self._end_abort_tickets(request, error)
        if switching_off:
            request.arming.drop(order)
            del self.requests[number]
        else:
            request.arming.switch_off(order)

    def _end(self, request: _Request, error: AxisbusError | None) -> None:
        ticket, request.ticket = request.ticket, None
        if ticket is not None:
            self._running.finish(ticket, error)

    def _end_abort_tickets(self, request: _Request, error: AxisbusError | None) -> None:
        abort_tickets, request.abort_tickets = request.abort_tickets, []
        for ticket in abort_tickets:
            self._running.finish(ticket, error)

    # -- the node ----------------------------------------------------------------------------------------------------

    def _require_node(self, ticket: CommandStatus, image: AxisImage) -> None:
        if not image.operational:
            raise StateError(
                f"{ticket.name}: node {self._parameters.node} is not operational",
                observed=nmt_text(image) if image.bus is None else image.bus.message,
                remedy=f"check its supply and cable; {when_back(self._parameters.node)}",
            )

    def _lost(self, image: AxisImage) -> NodeError:
        name, node = self._parameters.name, self._parameters.node
        return NodeError(
            f"{name}: node {node} is lost, and with it the result of its touch probe",
            node=node,
            observed=nmt_text(image) if image.bus is None else image.bus.message,
            remedy=f"check supply and cable of node {node}; then {boot_and_reset(node)}",
        )
