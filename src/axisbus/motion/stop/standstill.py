"""Detect standstill: from values newer than a given moment, and only if nothing pulls the axis elsewhere.

Theory of operation
-------------------
A requested stop is not a completed stop. An axis is *at standstill* if the following has been seen since a moment (the
beginning of a command, or of a step of the stop sequence):

1. Positions received after that moment stay within the tolerance of one position for the whole ``standstill_time``, and for at
   least three values (``SettledValue``). Values received before prove nothing, however fresh they may count: an event-driven
   position may be half a second old.
2. Nothing pulls or pushes: the controller's commanded position (6062h, and in csp the target that was sent) is within
   ``standstill_window`` of the actual position. An axis that is held by something else has a spring behind it, and leaps when it is
   released. In the torque modes the torque itself (6077h) must have gone.
   A 6062h that is not trusted (``DemandTrust``) shows nothing: then the position alone decides, and ``weaker_evidence`` reports
   this.
3. If there is no position: a velocity of 0 for the same time, else bit 10 in a word received well after the moment. This is
   weaker evidence, and ``weaker_evidence`` reports it.

The stop sequence, halt, stop, enable, moves, homing and ``set_position`` use the same definition.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from axisbus.cia402 import statusword as sw
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.errors import AxisbusError, StateError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.modes import TORQUE_MODES
from axisbus.motion.parameters import AxisParameters, DemandUse, HoldsLoad
from axisbus.motion.stop.settled_value import SettledValue

_PUSH = 50  # ‰ of rated torque: less is noise, or does not overcome friction


class StandstillCheck:
    """One check for standstill from ``since`` on, to be stepped in each cycle; holds the compared times and the last evidence."""

    __slots__ = (
        "_first",
        "_homing",
        "_parameters",
        "_pull_window",
        "_since",
        "_still_speed",
        "_weaker_evidence",
    )

    def __init__(self, parameters: AxisParameters, since: float, *, homing: bool = False) -> None:
        """``since``: values received at or before this moment do not count (seconds of the scan's clock).

        ``homing``: the drive has just changed the origin of its position, and 6062h may still refer to the old origin.
        """
        self._parameters = parameters
        self._pull_window = parameters.pull_window
        self._homing = homing
        self.begin(since)

    def begin(self, since: float) -> None:
        """Start the check again, from another moment on."""
        self._since = since
        self._first = math.inf  # when the first position after that arrived
        self._still_speed: SettledValue | None = None  # only if there is no position
        self._weaker_evidence = ""

    @property
    def weaker_evidence(self) -> str:
        """The weaker evidence by which the axis was seen at standstill; empty if the position proved it."""
        return self._weaker_evidence

    def seen(self, image: AxisImage) -> bool:
        """Evaluate this cycle's values; return whether the axis is at standstill."""
        if image.position is not None:
            self._weaker_evidence = ""
            if self._first == math.inf and image.position_stamp > self._since:
                self._first = image.position_stamp
            still = image.still
            at_standstill = (
                still.still
                and still.since(self._first)
                and self._knows_demand(image)
                and not self.pulls(image)
            )
            if at_standstill:
                self._weaker_evidence = self._by_position_alone(image)
            return at_standstill
        if image.velocity is not None:
            self._weaker_evidence = "its velocity (606Ch) is 0; its position is not known"
            return self._rests(image)
        self._weaker_evidence = (
            "its drive reports it (statusword bit 10); neither position nor velocity is known"
        )
        return self._says_so(image)

    def _by_position_alone(self, image: AxisImage) -> str:
        """Return the text for the case that 6062h exists but is not trusted, and no other value shows the controller's target."""
        hidden = image.shown_demand is not None and image.demand is None
        if not hidden or image.state not in ENERGISED or image.mode in TORQUE_MODES or image.pull is not None:
            return ""
        ignored = self._parameters.demand is DemandUse.IGNORE
        why = (
            'is not used (demand = "ignore")' if ignored else "has not yet been seen to follow the set-points"
        )
        return (
            "its position (6064h) does not change; whether its drive pushes against an obstacle is not known, because "
            f"6062h {why}"
        )

    def pulls(self, image: AxisImage) -> bool:
        """Whether the controller pulls the axis away from its position, or pushes it."""
        if self._pushes(image):
            return True
        pull = None if self._homing else image.pull
        return pull is not None and abs(pull) > self._pull_window

    def _pushes(self, image: AxisImage) -> bool:
        """Whether torque is left that has not decreased yet, or never will (6087h is 0). A torque that holds a load may stay."""
        if (
            image.mode not in TORQUE_MODES
            or image.state is not PowerState.OPERATION_ENABLED
            or image.torque is None
        ):
            return False
        return self._parameters.holds_load is HoldsLoad.NO and abs(image.torque) > _PUSH

    def _knows_demand(self, image: AxisImage) -> bool:
        """Whether 6062h shows the commanded position of the axis now that it rests.

        A polled value may date from the motion. If 6062h arrives as often as the position, it must be constant too: feedback may be
        late, and a motion may have just begun.
        """
        if not image.demand_repeats or not image.reference_tracker.counts(image.demand, image.mode):
            return True
        if image.state not in ENERGISED:
            return True  # nothing pulls without power
        if image.awaits_demand:
            return False
        if image.demand_stamp < image.position_stamp:
            return image.demand_stamp >= max(image.still.rested_since, self._first)
        return image.still_demand.since(self._first)

    def is_blocked(self, image: AxisImage) -> bool:
        """Whether the axis is at standstill only because something holds it."""
        return image.still.since(self._first) and self.pulls(image)

    def why_not(self, image: AxisImage) -> str:
        """Return the missing condition as text, for the error of a stop that was not confirmed."""
        units = self._parameters.units.position
        if image.position is None:
            return "its position (6064h) is not known"
        where = f"at {units.to_units(image.position - image.origin):g} {units.unit}"
        if image.position_stamp <= self._since:
            return f"{where} when its last position came, {image.now - image.position_stamp:.2g} s ago"
        if not image.still.since(self._first):
            return f"{where} and still moving{_speed_text(image, self._parameters)}"
        if self._pushes(image):
            return (
                f"held {where}, but its drive pushes with {abs(image.torque or 0) / 10:g} % of its rated torque (6077h): "
                "when it comes free, it moves"
            )
        pull = image.pull
        if pull is not None and self.pulls(image):
            return (
                f"held {where}, but its drive pulls it to a position {abs(units.to_units(pull)):g} {units.unit} away: when "
                "it comes free, it jumps"
            )
        return where

    def _rests(self, image: AxisImage) -> bool:
        units, speed = self._parameters.units, self._parameters.standstill_speed or 0.0
        velocity = float(image.velocity or 0)
        if units.ratio_known:
            velocity = abs(units.velocity.to_units(velocity) * units.position.factor)
        moving = math.copysign(1.0, velocity) if abs(velocity) > speed else 0.0
        if self._still_speed is None:
            self._still_speed = SettledValue(0.0, self._parameters.timing.standstill_time, self._since)
        return self._still_speed.feed(moving, image.velocity_stamp) and not moving

    def _says_so(self, image: AxisImage) -> bool:
        settled = self._since + max(self._parameters.timing.settle, self._parameters.timing.standstill_time)
        if image.statusword is None or image.statusword_stamp <= settled:
            return False
        return bool(image.statusword & sw.TARGET_REACHED)


def _speed_text(image: AxisImage, parameters: AxisParameters) -> str:
    if image.velocity is None:
        return ""
    velocity = parameters.units.velocity
    return f" at {velocity.to_units(image.velocity):g} {velocity.unit}"


# -- Commands that wait until the axis is seen at standstill, without commanding any motion ----------------------------


class StandstillWait:
    """One command that takes effect at standstill; holds its standstill check and its deadline.

    Both begin with the first step, so that a path along which the axis is still braking comes before.
    """

    __slots__ = ("_deadline", "_parameters", "_standstill_check", "then", "ticket")

    def __init__(self, parameters: AxisParameters, ticket: CommandStatus, then: Callable[[], None]) -> None:
        """``then`` is called once the axis is at standstill."""
        self._parameters = parameters
        self._standstill_check: StandstillCheck | None = None
        self._deadline = 0.0
        self.ticket = ticket
        self.then = then

    def step(self, image: AxisImage) -> bool:
        """Return True once the axis is seen at standstill.

        Raises:
            StateError: the axis continues to move.
        """
        if self._standstill_check is None:
            self._standstill_check = StandstillCheck(self._parameters, image.now)
            self._deadline = image.now + self._parameters.timing.transition
        if self._standstill_check.seen(image):
            return True
        if image.now > self._deadline:
            raise StateError(
                f"{self.ticket.name}: the axis is not at standstill",
                observed=self._standstill_check.why_not(image),
                remedy="wait until it is at standstill; an axis that is turned by hand or by its load counts as moving, too",
            )
        return False


class StandstillWaiters:
    """The commands of one axis that wait for its standstill, in ``waiting``."""

    __slots__ = ("_parameters", "waiting")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self.waiting: list[StandstillWait] = []

    def add(self, ticket: CommandStatus, then: Callable[[], None]) -> None:
        """Call ``then`` once the axis is at standstill; the ticket ends after that."""
        self.waiting.append(StandstillWait(self._parameters, ticket, then))
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
