"""Homing of a pair: both are led together until their touch probes have seen their switches, and squared then.

Theory of operation
-------------------
1. The touch probes of the axes that have a switch are armed (60B8h); nothing moves before both are.
2. Both are led along one line towards the switches. The drives latch where they are at their edges. When the first edge has come
   both go on, together, for the other one: the beam stays as it stands. The second edge shows how far it is out of square. It must
   come before that is more than the plan's ``skew``; else both stop, and nothing is homed.
3. Both brake to rest on their line. Each position is counted anew from its edge.
4. The second axis goes alone until the beam is square, with the velocity of the search; where the switches lie beyond the position
   limits, both come back to these meanwhile.

So the axes are never led apart but to square the beam, and no farther than the plan's ``skew``, which is the bound of the watch
meanwhile. Whatever else is told to the pair (a halt, a stop, a fault) ends it, as it ends a line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from copy import copy
from functools import partial

from axisbus.cia402.touch_probe import ProbeSource
from axisbus.errors import AxisbusError, HomingError, SkewError, StateError, Stopped
from axisbus.motion import commands as c
from axisbus.motion.axis.accept import accept
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, Status, end_as, unattended
from axisbus.motion.gantry.commands import GantryHome
from axisbus.motion.gantry.parameters import GantryParameters, SwitchSearch
from axisbus.motion.gantry.skew import SkewMonitor, led_place_of, place_of
from axisbus.motion.states import AxisState
from axisbus.motion.user_code_errors import broken

Lead = Callable[[Mapping[str, float], float, CommandStatus], None]
_LATE = 0.05  # seconds in which an edge may have been latched and is not seen yet


class GantryHoming:
    """Holds the tickets of what the axes are told, and at which increment each has seen its edge."""

    def __init__(
        self,
        parameters: GantryParameters,
        plan: SwitchSearch,
        command: GantryHome,
        axes: Mapping[str, AxisCore],
        watch: SkewMonitor,
        ticket: CommandStatus,
    ) -> None:
        self._parameters, self._plan, self._command = parameters, plan, command
        self._axes, self._watch, self._ticket = axes, watch, ticket
        self._edges: dict[str, int] = {}  # unwrapped increments
        names = parameters.axes if plan.each else parameters.axes[:1]
        self._probes = {
            name: CommandStatus(f"{ticket.name} [{name}: probe]", partial(self._hear, name)) for name in names
        }
        self._line = CommandStatus(f"{ticket.name} [search]")
        self._lead: Lead
        self._do: Callable[[], None] = self._arm
        self._arrived_at = math.inf

    def begin(self, lead: Lead) -> None:
        """Arm the touch probes; ``lead`` leads both along a line to some ends, with a velocity, for a ticket."""
        self._lead = lead
        self._ticket.begin()
        plan = self._plan
        for name, ticket in self._probes.items():
            probe = c.Probe(
                plan.input, frozenset({plan.edge}), ProbeSource.INPUT, False, None, self._command.key
            )
            accept(self._axes[name], probe, ticket)

    @property
    def busy(self) -> bool:
        """Whether it has not ended."""
        return self._ticket.busy

    @property
    def name(self) -> str:
        """What was asked for."""
        return self._ticket.name

    @property
    def error(self) -> AxisbusError | None:
        """What has ended it, where that is an error."""
        return self._ticket.error

    def abandon(self, error: AxisbusError) -> None:
        """End it with ``error``: the scan has ended."""
        self._ticket.finish(Status.ERROR, error)

    def step(self) -> None:
        """Once per cycle, before the axes."""
        if not self.busy:
            return
        try:
            self._do()
        except Exception as error:  # noqa: BLE001  # whatever it is, it ends this command and stops its axes
            self.give_up(broken(error, self.name))

    def give_up(self, error: AxisbusError) -> None:
        """End it with ``error``, and halt what it has under way."""
        if not self.busy:
            return
        for name, core in self._axes.items():
            if self._line.busy and self._line.status is Status.ACTIVE and not isinstance(error, SkewError):
                stop = c.PolicyStop(f"{self.name} was stopped because {error.message}")
                accept(core, stop, unattended(f"{name}.stop"))
        self._end(error)

    # -- one after the other -------------------------------------------------------------------------------------------

    def _arm(self) -> None:
        """Wait until all are armed, then go."""
        self._require_undisturbed()
        self._require_probes()
        if not all(probe.status is Status.ACTIVE for probe in self._probes.values()):
            return
        self._watch.bound = max(self._plan.skew, self._watch.bound)
        ends = {name: self._led(name) + self._plan.distance for name in self._parameters.axes}
        self._lead(ends, self._plan.velocity, self._line)
        self._do = self._search

    def _search(self) -> None:
        """Both go together; the second edge must come before the beam is too far out of square."""
        if self._line.error is not None:
            self._end(self._line.error)
        elif len(self._edges) == len(self._probes):
            self._line = CommandStatus(f"{self.name} [halt]")
            self._halt(self._line)
            self._do = self._rest
        else:
            self._require_probes()
            self._require_near()
            if not self._line.busy:
                self._look_once_more()

    def _halt(self, ticket: CommandStatus) -> None:
        children = [CommandStatus(ticket.name) for _ in self._axes]
        for core, child in zip(self._axes.values(), children, strict=True):
            child.then(partial(_gather, children, ticket))
            accept(core, c.Halt(), child)

    def _rest(self) -> None:
        """At rest, count both anew."""
        self._require_undisturbed(f"{self._line.name} was asked for")
        if self._line.busy:
            return
        if self._line.error is not None:
            self._end(self._line.error)
            return
        skew = self._found_skew()
        if abs(skew) > self._plan.skew:
            raise self._too_skew(f"it is {abs(skew):.6g} {self._watch.unit} out of square")
        self._count_anew()
        self._watch.look()
        if not self._plan.each:
            self._end(None)
            return
        self._line = CommandStatus(f"{self.name} [square]")
        first, second = self._parameters.axes
        here = self._within_limits(self._led(first))
        self._lead({first: here, second: here + self._parameters.offset}, self._plan.velocity, self._line)
        self._do = self._square

    def _within_limits(self, place: float) -> float:
        """Return the place nearest to ``place`` at which a square beam is within the limits of both: switches often lie beyond."""
        first, second = (self._axes[name].parameters.limits.position for name in self._parameters.axes)
        for limits, more in ((first, 0.0), (second, self._parameters.offset)):
            if limits is not None:
                place = min(max(place, limits[0] - more), limits[1] - more)
        return place

    def _square(self) -> None:
        if self._line.busy:
            return
        self._end(self._line.error)

    # -- what is known -------------------------------------------------------------------------------------------------

    def _hear(self, name: str, probe: CommandStatus) -> None:
        if probe.capture is not None:
            self._edges.setdefault(name, probe.capture.position)

    def _led(self, name: str) -> float:
        place = led_place_of(self._axes[name])
        assert place is not None  # the watch has seen both
        return place

    def _found_skew(self) -> float:
        """Return how far the beam is out of square, by both edges; with one switch it is taken to be square."""
        if not self._plan.each:
            return 0.0
        a, b = (self._since_edge(name) for name in self._parameters.axes)
        return b - a + self._plan.positions[1] - self._plan.positions[0] - self._parameters.offset

    def _since_edge(self, name: str) -> float:
        """Return how far an axis is beyond its edge."""
        core = self._axes[name]
        here = core.image.position
        assert here is not None
        return core.parameters.units.position.to_units(here - self._edges[name])

    def _count_anew(self) -> None:
        first, second = self._parameters.axes
        place = self._since_edge(first) + self._plan.positions[0]
        other = place + self._parameters.offset
        if self._plan.each:
            other = self._since_edge(second) + self._plan.positions[1]
        for name, where in ((first, place), (second, other)):
            core = self._axes[name]
            here = core.image.position
            assert here is not None
            core.confirm_position(here - core.parameters.units.position.to_increments(where))

    # -- what is wrong -------------------------------------------------------------------------------------------------

    def _require_undisturbed(self, reason: str = "") -> None:
        """Raise where a stop has come while no line leads the axes that it would end; ``reason``: of the halt of its own."""
        for core in self._axes.values():
            if core.state is AxisState.ERRORSTOP and core.error is not None:
                raise copy(core.error)
            if core.ladder is not None and core.stopping.reason != reason:
                raise Stopped(core.stopping.reason)
            if core.state is not AxisState.STANDSTILL and not reason:
                raise StateError(f"{self.name}: {core.parameters.name} is {core.state.value}")

    def _require_probes(self) -> None:
        """Raise where a touch probe has ended without an edge."""
        for name, probe in self._probes.items():
            if not probe.busy and name not in self._edges:
                raise probe.error or HomingError(
                    f"{self.name}: the touch probe of {name} was switched off", axis=name
                )

    def _require_near(self) -> None:
        """Raise where one edge has come, and the other is farther away than the beam may be out of square."""
        seen = next(iter(self._edges), None)
        if seen is None or place_of(self._axes[seen]) is None:
            return
        first, second = self._parameters.axes
        gone = abs(self._since_edge(seen))
        switches = self._plan.positions[1] - self._plan.positions[0] - self._parameters.offset
        allowed = self._plan.skew + math.copysign(1.0, self._plan.distance) * (
            switches if seen == first else -switches
        )
        # The drive tells of its edge a little later than it was.
        if gone > allowed + self._plan.velocity * _LATE:
            missing = second if seen == first else first
            raise self._too_skew(
                f"{seen} has seen its switch, and {missing} not within {gone:.6g} {self._watch.unit} more"
            )

    def _too_skew(self, observed: str) -> HomingError:
        first, second = self._parameters.axes
        return HomingError(
            f"{self.name}: the switches of {first} and {second} do not agree within skew = {self._plan.skew:g} {self._watch.unit}",
            observed=observed,
            remedy="look at both switches and their wiring (60FDh shows the inputs), and at the beam; then correct positions or "
            f"skew in [gantries.{self._parameters.name}.homing]",
        )

    def _look_once_more(self) -> None:
        """The line has ended: an edge shortly before that may not have been seen yet."""
        now = max(core.image.now for core in self._axes.values())
        self._arrived_at = min(self._arrived_at, now)
        if now < self._arrived_at + _LATE:
            return
        missing = [name for name in self._probes if name not in self._edges]
        raise HomingError(
            f"{self.name}: no switch was seen within {abs(self._plan.distance):g} {self._watch.unit}",
            observed=f"missing is that of {' and '.join(missing)}",
            remedy="look at the switch and its wiring (60FDh shows the inputs), and at distance and edge "
            f"in [gantries.{self._parameters.name}.homing]",
        )

    def _end(self, error: AxisbusError | None) -> None:
        for name, probe in self._probes.items():
            if probe.busy:
                abort = c.ProbeAbort(self._plan.input, self._command.key)
                accept(self._axes[name], abort, CommandStatus(f"{self.name} [abort]"))
        self._watch.narrow()
        self._ticket.finish(Status.DONE if error is None else end_as(error), error)


def _gather(children: list[CommandStatus], ticket: CommandStatus) -> None:
    """End ``ticket`` when all have ended."""
    if any(child.busy for child in children):
        return
    error = next((child.error for child in children if child.error is not None), None)
    ticket.finish(Status.DONE if error is None else end_as(error), error)
