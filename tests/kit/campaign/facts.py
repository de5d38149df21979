"""The knowledge of the campaign's rules: the cell, commands, faults, and reports of the master."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from axisbus.errors import AxisbusError
from axisbus.machine.handle import Handle
from kit.campaign.commands import QUIET
from kit.campaign.faults import MISHAPS, Mishap, Site
from kit.campaign.scenes import Scene
from kit.campaign.violation import Violation
from kit.cell import Cell
from kit.plant_probe import OFF

TORQUE_MODES = (4, 10)
SMALL_TORQUE = 50  # ‰ of rated torque, which the master takes for noise
MOVES = 5.0  # deg/s: faster is moving (an axis that rings, or the last of a lag, is slower)
_REMEMBERED = 6.0  # s for which a trouble that is over may still be the cause of an error
_LITTLE = 3.0  # s for the steps of a stop that have no time of their own
_POWER = frozenset({"enable", "disable", "coast"})
_TAKES_POWER = frozenset({"disable", "coast", "quick_stop"})
_OF_NODES = frozenset(
    {"alive", "start", "heartbeat", "sdo_well", "supply_returns"}
)  # the end of a fault of a node, for all of its axes
HONEST = ("MOVING", "could not be confirmed", "NOT CONFIRMED", "ENERGISED", "is lost", "still energised")

_PULLED = 5.0  # s: for so long a motor without power may move after it was pulled
_CAUGHT = 0.5  # s that an axis must have been at standstill against its command, to be known as held


@dataclass
class GivenCommand:
    """A command that was given; ``goals``: the known target of each axis, in increments of the drive.

    On a drawn cell: ``kind`` is that of the order, ``legal`` whether the command must end well, ``direction`` (1 or -1) that of the
    motion from standstill, and ``starts`` the position of each motor at the call.
    """

    what: str
    names: str
    handle: Handle
    since: float
    goals: dict[str, float] = field(default_factory=dict)
    ended: float | None = None
    kind: str = ""
    legal: bool = False
    direction: float = 0.0
    starts: dict[str, float] = field(default_factory=dict)

    @property
    def error(self) -> AxisbusError | None:
        return self.handle.exception()


@dataclass
class Trouble:
    """A fault of one axis, its origin, its begin and its end."""

    what: str
    axis: str
    since: float
    until: float = math.inf

    @property
    def kind(self) -> Mishap:
        return MISHAPS[self.what]


class Facts:
    """Holds the history of one script."""

    def __init__(self, site: Site, scene: Scene) -> None:
        self.cell: Cell = site.cell
        self.site = site
        self.scene = scene
        self.names = scene.names
        self.asked: list[GivenCommand] = []
        self.troubles: dict[str, list[Trouble]] = {name: [] for name in scene.names}
        self.at = ""
        self.worst = 0.0  # seconds that a stop took at most
        self.tally: Counter[str] = Counter()  # how often each rule was checked, and each command given
        self.core = {name: self.cell.core(name) for name in scene.names}
        self.drive = {name: self.cell.drive(name) for name in scene.names}
        self._lost_sight: set[str] = set()  # axes whose feedback lied while they coasted, and that turn still
        self.scale = {name: self.cell.scale_of(name) for name in scene.names}
        self._clock = self.cell.clock
        self._moving = {
            name: max(MOVES * abs(self.scale[name]), self.unseen_speed(name)) for name in scene.names
        }

    @property
    def now(self) -> float:
        return self._clock.now()

    # -- faults ----------------------------------------------------------------------------------------------------------

    def begin(self, what: str, axis: str) -> list[str]:
        """A fault begins; return the axes that it may affect (those of one node, or of one beam, share it)."""
        kind = MISHAPS[what]
        befallen = [name for name in self.names if kind.shared or self._share_node(name, axis)]
        for name in befallen:
            until = math.inf if kind.ends else self.now
            self.troubles[name].append(Trouble(what, axis, self.now, until))
        return befallen

    def end(self, what: str, axis: str) -> None:
        """A fault ends."""
        for name, troubles in self.troubles.items():
            for trouble in troubles:
                here = trouble.kind.shared or trouble.axis == axis or what in _OF_NODES
                here = here and (trouble.kind.shared or self._share_node(name, axis))
                if here and trouble.kind.ends == what and trouble.until > self.now:
                    trouble.until = self.now

    def _share_node(self, name: str, other: str) -> bool:
        beam = {name, other} <= set(self.scene.pair)
        return beam or self.cell.device(name) is self.cell.device(other)

    def troubled(self, name: str, within: float) -> Iterator[Trouble]:
        """The troubles of an axis that last, or ended less than ``within`` seconds ago."""
        return (trouble for trouble in self.troubles[name] if trouble.until > self.now - within)

    def remembers(self, name: str) -> float:
        """Return for how long a trouble that is over may still be the cause of an error, in s: a stop waits its times for it."""
        times = self.core[name].parameters.stop_times
        return max(_REMEMBERED, 2.0 + times.halt + times.quick_stop)

    def look(self, name: str) -> None:
        """Take this cycle's values."""
        if not self.moves(name) or self.stage(name) not in OFF:
            self._lost_sight.discard(name)
        elif self.drive[name].dials.encoder_frozen or self._begins_to_lag(name):
            self._lost_sight.add(name)

    def _begins_to_lag(self, name: str) -> bool:
        """Whether its feedback has just become late: until the first late value, it seems constant."""
        lags = (trouble for trouble in self.troubles[name] if trouble.what == "late_feedback")
        return any(trouble.since > self.now - 0.2 for trouble in lags)

    def turns_unseen(self, name: str) -> bool:
        """Whether neither the feedback nor a demand shows the motor: its motion cannot be known.

        If the feedback was wrong while the motor ran down, a later motion may be one by hand.
        """
        dials = self.drive[name].dials
        demanded = self._shows_demand(name) and not dials.demand_frozen
        lies = dials.encoder_frozen or self._begins_to_lag(name)
        blind = lies and (self.stage(name) in OFF or not demanded)
        return blind or name in self._lost_sight

    def _shows_demand(self, name: str) -> bool:
        """Whether a demand is known, and comes so often that it shows a motion within the time in which positions are compared."""
        core = self.core[name]
        shortest = core.parameters.timing.standstill_time + 4.0 * self.scene.period
        seldom = core.capabilities.max_age.get("demand", 0.0) > max(0.1, shortest)
        return core.image.demand is not None and not seldom

    def is_caught_unseen(self, name: str, stop: GivenCommand) -> bool:
        """Whether something caught the axis while it was being stopped, or just before, and no value shows its demand."""
        caught = any(
            trouble.what == "jam" and trouble.since > stop.since - _CAUGHT
            for trouble in self.troubled(name, 0.0)
        )
        image = self.core[name].image
        return caught and image.position is None and image.demand is None

    def is_held_unseen(self, name: str) -> bool:
        """Whether something holds the axis, or did just now, and its drive shows no demand by which that could be known."""
        held = any(trouble.what == "jam" for trouble in self.troubled(name, _CAUGHT))
        return held and self.core[name].image.demand is None

    def has_a_will(self, name: str) -> bool:
        """Whether the drive moves without a command: then a short standstill is no promise.

        So does one with a torque left (6087h is 0) that counts as none, but overcomes the friction of this motor.
        """
        drive = self.drive[name]
        pushed = drive.mode in TORQUE_MODES and drive.params.friction < abs(drive.torque) <= SMALL_TORQUE
        return bool(drive.dials.drift_velocity) or drive.dials.spontaneous_mode is not None or pushed

    def hangs(self, name: str) -> bool:
        """Whether its motor alone holds a load, or a bent beam pulls on it, or did just now."""
        params = self.drive[name].params
        return (bool(params.load) and not params.brake) or self.is_pulled(name)

    def is_pulled(self, name: str) -> bool:
        """Whether its beam, or a person, pulls on it with more than its friction, or did so recently."""
        pulled = getattr(self.cell, "pulled", {})
        return name in pulled and pulled[name] > self.drive[name].time - _PULLED

    def may_fall(self, name: str) -> bool:
        """Whether a load that only the motor holds is without power, or was released by its user."""
        return (self.hangs(name) and self.stage(name) in OFF) or self.is_dropped(name)

    def is_dropped(self, name: str) -> bool:
        """Whether its user has released a load that only the motor holds: it falls."""
        own = [asked.what for asked in self.asked if name in asked.names and asked.what in _POWER]
        return self.hangs(name) and bool(own) and own[-1] != "enable"

    # -- commands --------------------------------------------------------------------------------------------------------

    def later(self, asked: GivenCommand, name: str) -> bool:
        """Whether something that moves this axis was asked after it."""
        after = self.asked[self.asked.index(asked) + 1 :]
        return any(other.what not in QUIET and name in other.names for other in after)

    def power_removed_after(self, asked: GivenCommand, name: str) -> bool:
        """Whether its power was asked to go, or a stop that may take it, after this command."""
        after = self.asked[self.asked.index(asked) + 1 :]
        return any(other.what in _TAKES_POWER and name in other.names for other in after)

    # -- reports of the master -------------------------------------------------------------------------------------------

    def is_reported_as_moving(self, name: str, text: str = "") -> bool:
        """Whether the master reports an axis as possibly moving, or still energised."""
        error = self.core[name].error
        lines = [str(error)] if error is not None else []
        lines += [part for part in text.split("\0") if f"{name}: " in part or f"[{name}]" in part]
        return any(word in line for line in lines for word in HONEST)

    def unseen_speed(self, name: str) -> float:
        """Return the highest speed in increments per s that may look like standstill.

        A position that changes by the tolerance and a part of an increment is within it. So is one that changes by as much more as
        the noise of the first and of the last value can hide.
        """
        parameters, noise = self.core[name].parameters, self.drive[name].params.noise
        return (parameters.standstill_tolerance + 1.0 + 2.0 * noise) / parameters.timing.standstill_time

    def moves(self, name: str) -> bool:
        return abs(self.drive[name].axis.motor.velocity) > self._moving[name]

    def stops_in(self, name: str) -> float:
        """Return how long a stop may take that goes through all its steps, in s: the times of the cell file, and a little more."""
        times = self.core[name].parameters.stop_times
        return times.halt + times.quick_stop + times.disable + _LITTLE

    def where(self, name: str) -> float:
        """The position of the motor of an axis, in its unit, 0 at power-up."""
        return self.drive[name].axis.motor.position / self.scale[name]

    def turned(self, name: str) -> int:
        """-1 if the drive counts in the opposite direction of its motor (607Eh), else 1."""
        return -1 if self.drive[name].settings.polarity & 0x80 else 1

    def stage(self, name: str) -> int:
        """The state of the power stage, by the simulated drive's number."""
        return int(self.drive[name].power.stage)

    def place(self, name: str) -> float:
        """Where the motor of an axis is, in increments as its drive counts them (unwrapped)."""
        axis = self.drive[name].axis
        return axis.to_user(axis.motor.position)

    def origin(self, name: str) -> float:
        return self.core[name].image.origin

    def must(
        self, holds: bool, rule: str, text: str | Callable[[], str], error: Exception | None = None
    ) -> None:
        """Require a rule; ``text`` may be a function, because making it takes time. ``error``: the error of the command.

        Raises:
            Violation: it does not hold.
        """
        self.tally[f"rule: {rule}"] += 1
        if not holds:
            said = text if isinstance(text, str) else text()
            raise Violation(rule, f"at {self.now:.2f} s, before {self.at}: {said}", error)
