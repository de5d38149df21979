"""Homing of a pair: both axes move together until their touch probes have latched their switches, then the beam is squared.

Theory of operation
-------------------
1. The touch probes of the axes that have a switch are armed (60B8h); nothing moves before all are armed.
2. Both axes move along one line towards the switches. Each drive latches its position at its own edge. After the first edge both
   axes continue together towards the other edge, so the skew of the beam does not change. The second edge shows the skew. It must
   come before the skew exceeds the plan's ``skew``; otherwise both axes stop and are not homed.
3. Both axes brake to rest on their line. Each position is then referenced to its edge.
4. The second axis moves alone until the beam is square, at the search velocity. If the switches are outside the position limits,
   both axes return to the limits in the same motion.

So the axes move relative to each other only to square the beam, and by no more than the plan's ``skew``, which is the monitor's
bound meanwhile. Any other command to the pair (a halt, a stop) and any fault ends homing, as it would end a line.
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
from axisbus.motion.command_status import CommandStatus, Status, broken, end_as, unattended
from axisbus.motion.gantry.commands import GantryHome
from axisbus.motion.gantry.parameters import GantryParameters, SwitchSearch
from axisbus.motion.gantry.skew import SkewMonitor, actual_position_of, demand_position_of
from axisbus.motion.states import AxisState

MoveBoth = Callable[[Mapping[str, float], float, CommandStatus], None]
_EDGE_DELAY = 0.05  # seconds within which a latched edge may not have been received yet


class GantryHoming:
    """Holds the tickets of the axes' commands, and the position in increments at which each axis has latched its edge."""

    def __init__(
        self,
        parameters: GantryParameters,
        plan: SwitchSearch,
        command: GantryHome,
        axes: Mapping[str, AxisCore],
        monitor: SkewMonitor,
        ticket: CommandStatus,
    ) -> None:
        self._parameters, self._plan, self._command = parameters, plan, command
        self._axes, self._monitor, self._ticket = axes, monitor, ticket
        self._edges: dict[str, int] = {}  # unwrapped increments
        names = parameters.axes if plan.each else parameters.axes[:1]
        self._probes = {
            name: CommandStatus(f"{ticket.name} [{name}: probe]", partial(self._on_probe, name))
            for name in names
        }
        self._motion_ticket = CommandStatus(f"{ticket.name} [search]")
        self._move_both: MoveBoth
        self._next_step: Callable[[], None] = self._arm
        self._arrived_at = math.inf

    def begin(self, move_both: MoveBoth) -> None:
        """Arm the touch probes; ``move_both`` moves both axes along a line to given ends, at a velocity, for a ticket."""
        self._move_both = move_both
        self._ticket.begin()
        plan = self._plan
        for name, ticket in self._probes.items():
            probe = c.Probe(
                plan.input, frozenset({plan.edge}), ProbeSource.INPUT, False, None, self._command.key
            )
            accept(self._axes[name], probe, ticket)

    @property
    def busy(self) -> bool:
        """Whether homing has not ended."""
        return self._ticket.busy

    @property
    def name(self) -> str:
        """The name of the command."""
        return self._ticket.name

    @property
    def error(self) -> AxisbusError | None:
        """The error that has ended homing, or None."""
        return self._ticket.error

    def abandon(self, error: AxisbusError) -> None:
        """End homing with ``error``: the scan has ended."""
        self._ticket.finish(Status.ERROR, error)

    def step(self) -> None:
        """Advance homing; called once per cycle, before the axes step."""
        if not self.busy:
            return
        try:
            self._next_step()
        except Exception as error:  # noqa: BLE001  # any exception ends this command and stops its axes
            self.give_up(broken(error, self.name))

    def give_up(self, error: AxisbusError) -> None:
        """End homing with ``error``, and stop its active motion."""
        if not self.busy:
            return
        for name, core in self._axes.items():
            if (
                self._motion_ticket.busy
                and self._motion_ticket.status is Status.ACTIVE
                and not isinstance(error, SkewError)
            ):
                stop = c.PolicyStop(f"{self.name} was stopped because {error.message}")
                accept(core, stop, unattended(f"{name}.stop"))
        self._end(error)

    # -- the steps -----------------------------------------------------------------------------------------------------

    def _arm(self) -> None:
        """Wait until all touch probes are armed, then begin to move."""
        self._require_undisturbed()
        self._require_probes()
        if not all(probe.status is Status.ACTIVE for probe in self._probes.values()):
            return
        self._monitor.bound = max(self._plan.skew, self._monitor.bound)
        ends = {name: self._demand_position(name) + self._plan.distance for name in self._parameters.axes}
        self._move_both(ends, self._plan.velocity, self._motion_ticket)
        self._next_step = self._search

    def _search(self) -> None:
        """Move both axes together; the second edge must come before the beam is too far out of square."""
        if self._motion_ticket.error is not None:
            self._end(self._motion_ticket.error)
        elif len(self._edges) == len(self._probes):
            self._motion_ticket = CommandStatus(f"{self.name} [halt]")
            self._halt(self._motion_ticket)
            self._next_step = self._rest
        else:
            self._require_probes()
            self._require_near()
            if not self._motion_ticket.busy:
                self._wait_for_last_edge()

    def _halt(self, ticket: CommandStatus) -> None:
        children = [CommandStatus(ticket.name) for _ in self._axes]
        for core, child in zip(self._axes.values(), children, strict=True):
            child.then(partial(_gather, children, ticket))
            accept(core, c.Halt(), child)

    def _rest(self) -> None:
        """At rest, reference both axes."""
        self._require_undisturbed(f"{self._motion_ticket.name} was asked for")
        if self._motion_ticket.busy:
            return
        if self._motion_ticket.error is not None:
            self._end(self._motion_ticket.error)
            return
        skew = self._found_skew()
        if abs(skew) > self._plan.skew:
            raise self._disagreement(f"it is {abs(skew):.6g} {self._monitor.unit} out of square")
        self._reference_positions()
        self._monitor.update()
        if not self._plan.each:
            self._end(None)
            return
        self._motion_ticket = CommandStatus(f"{self.name} [square]")
        first, second = self._parameters.axes
        here = self._within_limits(self._demand_position(first))
        self._move_both(
            {first: here, second: here + self._parameters.offset}, self._plan.velocity, self._motion_ticket
        )
        self._next_step = self._square

    def _within_limits(self, position: float) -> float:
        """Return the position nearest to ``position`` that keeps a square beam in both axes' limits; switches are often outside."""
        first, second = (self._axes[name].parameters.limits.position for name in self._parameters.axes)
        for limits, more in ((first, 0.0), (second, self._parameters.offset)):
            if limits is not None:
                position = min(max(position, limits[0] - more), limits[1] - more)
        return position

    def _square(self) -> None:
        if self._motion_ticket.busy:
            return
        self._end(self._motion_ticket.error)

    # -- measured values -----------------------------------------------------------------------------------------------

    def _on_probe(self, name: str, probe: CommandStatus) -> None:
        if probe.capture is not None:
            self._edges.setdefault(name, probe.capture.position)

    def _demand_position(self, name: str) -> float:
        position = demand_position_of(self._axes[name])
        assert position is not None  # the monitor has seen both
        return position

    def _found_skew(self) -> float:
        """Return the skew of the beam from both edges; with one switch, the beam is assumed to be square."""
        if not self._plan.each:
            return 0.0
        a, b = (self._since_edge(name) for name in self._parameters.axes)
        return b - a + self._plan.positions[1] - self._plan.positions[0] - self._parameters.offset

    def _since_edge(self, name: str) -> float:
        """Return the distance of an axis from its edge, in its unit."""
        core = self._axes[name]
        here = core.image.position
        assert here is not None
        return core.parameters.units.position.to_units(here - self._edges[name])

    def _reference_positions(self) -> None:
        first, second = self._parameters.axes
        position = self._since_edge(first) + self._plan.positions[0]
        other = position + self._parameters.offset
        if self._plan.each:
            other = self._since_edge(second) + self._plan.positions[1]
        for name, position_of_axis in ((first, position), (second, other)):
            core = self._axes[name]
            here = core.image.position
            assert here is not None
            core.confirm_position(here - core.parameters.units.position.to_increments(position_of_axis))

    # -- errors --------------------------------------------------------------------------------------------------------

    def _require_undisturbed(self, reason: str = "") -> None:
        """Raise if the axes were stopped while no line commands them; ``reason``: the reason of homing's own halt."""
        for core in self._axes.values():
            if core.state is AxisState.ERRORSTOP and core.error is not None:
                raise copy(core.error)
            if core.stop_sequence is not None and core.stopping.reason != reason:
                raise Stopped(core.stopping.reason)
            if core.state is not AxisState.STANDSTILL and not reason:
                raise StateError(f"{self.name}: {core.parameters.name} is {core.state.value}")

    def _require_probes(self) -> None:
        """Raise if a touch probe has ended without an edge."""
        for name, probe in self._probes.items():
            if not probe.busy and name not in self._edges:
                raise probe.error or HomingError(
                    f"{self.name}: the touch probe of {name} was switched off", axis=name
                )

    def _require_near(self) -> None:
        """Raise if one edge has come and the other has not come within the permitted skew."""
        found = next(iter(self._edges), None)
        if found is None or actual_position_of(self._axes[found]) is None:
            return
        first, second = self._parameters.axes
        distance = abs(self._since_edge(found))
        switches = self._plan.positions[1] - self._plan.positions[0] - self._parameters.offset
        allowed = self._plan.skew + math.copysign(1.0, self._plan.distance) * (
            switches if found == first else -switches
        )
        # The drive reports its edge with a small delay.
        if distance > allowed + self._plan.velocity * _EDGE_DELAY:
            missing = second if found == first else first
            raise self._disagreement(
                f"{found} has reached its switch, and {missing} has not within another {distance:.6g} {self._monitor.unit}"
            )

    def _disagreement(self, observed: str) -> HomingError:
        first, second = self._parameters.axes
        return HomingError(
            f"{self.name}: the switches of {first} and {second} do not agree "
            f"within skew = {self._plan.skew:g} {self._monitor.unit}",
            observed=observed,
            remedy="check both switches and their wiring (60FDh shows the inputs), and the beam; then correct positions or "
            f"skew in [gantries.{self._parameters.name}.homing]",
        )

    def _wait_for_last_edge(self) -> None:
        """After the end of the line, wait for an edge that may not have been received yet, then raise HomingError."""
        now = max(core.image.now for core in self._axes.values())
        self._arrived_at = min(self._arrived_at, now)
        if now < self._arrived_at + _EDGE_DELAY:
            return
        missing = [name for name in self._probes if name not in self._edges]
        raise HomingError(
            f"{self.name}: a switch was not found within {abs(self._plan.distance):g} {self._monitor.unit}",
            observed=f"not found: the switch of {' and '.join(missing)}",
            remedy="check the switch and its wiring (60FDh shows the inputs), and distance and edge in "
            f"[gantries.{self._parameters.name}.homing]",
        )

    def _end(self, error: AxisbusError | None) -> None:
        for name, probe in self._probes.items():
            if probe.busy:
                abort = c.ProbeAbort(self._plan.input, self._command.key)
                accept(self._axes[name], abort, CommandStatus(f"{self.name} [abort]"))
        self._monitor.restore_bound()
        self._ticket.finish(Status.DONE if error is None else end_as(error), error)


def _gather(children: list[CommandStatus], ticket: CommandStatus) -> None:
    """End ``ticket`` when all ``children`` have ended."""
    if any(child.busy for child in children):
        return
    error = next((child.error for child in children if child.error is not None), None)
    ticket.finish(Status.DONE if error is None else end_as(error), error)
