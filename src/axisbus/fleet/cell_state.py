"""State of one cell, derived from the messages received and their local arrival times; this module reads no clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from axisbus.fleet.events import EventLog
from axisbus.fleet.messages import PROTOCOL, AxisInfo, AxisStateMessage, CellInfo, Event
from axisbus.version import __version__

FRESH = 1.0  # seconds: an older state counts as unknown
UNKNOWN = "unknown"  # the state of an axis whose state the cell does not know
AXES = 256  # the most axes that a cell may have
_OVER = 100  # the number of ended runs that are remembered
_MISSED = 2.0  # seconds after which the token of a killed bridge is certainly gone


class LastAxisState(NamedTuple):
    """The last reported state of an axis. ``age``: its age now in seconds, None if unknown; ``fresh``: whether it is valid."""

    state: AxisStateMessage
    age: float | None
    fresh: bool


@dataclass(frozen=True, slots=True)
class _Heard:
    state: AxisStateMessage
    at: float


class CellWatch:
    """One cell as its messages report it. All times are seconds of the local monotonic clock, given by the caller.

    When a new run of a bridge replaces a run, the old run is over and its later messages are ignored. If two bridges are
    present, the first one that was heard counts. If both stay for longer than the token of a killed bridge can last, two
    bridges use one name.
    """

    def __init__(self, name: str, now: float) -> None:
        self.name = name
        self.alive = False
        self.since = now  # when the cell last appeared or disappeared
        self.info: CellInfo | None = None
        self.informed = False  # whether ``info`` describes the machine that runs now
        self.run = ""  # the run of the bridge whose messages count
        self.log = EventLog()
        self.clock_difference: float | None = None
        self._states: dict[str, _Heard] = {}
        self._over: dict[str, None] = {}  # runs that are over, oldest first
        self._bridges: dict[str, float] = {}  # the bridges that are present, and since when

    # -- messages ------------------------------------------------------------------------------------------------------

    def token(self, there: bool, now: float) -> None:
        """Note that the cell's liveliness token has appeared or disappeared."""
        if there != self.alive:
            self.alive, self.since = there, now
            self.informed = False  # it may be another machine, with a changed cell file
            self.log.doubt()

    def presence(self, bridge: str, there: bool, now: float) -> None:
        """Note that a bridge with this name has appeared or disappeared."""
        if not there:
            self._bridges.pop(bridge, None)
        else:
            self._bridges.setdefault(bridge, now)

    def take_info(self, info: CellInfo, wall: float) -> bool:
        """Store the description of the cell; return False, and store nothing, if it comes from a run that is over."""
        if not self._of_now(info.bridge):
            return False
        self.info, self.informed = info, True
        self.clock_difference = info.clock - wall
        return True

    def take_state(self, axis: str, state: AxisStateMessage, now: float, wall: float) -> bool:
        """Store the state of an axis; return whether it is newer than the stored one."""
        if not self._of_now(state.bridge):
            return False
        heard = self._states.get(axis)
        late = heard is not None and state.n <= heard.state.n
        if late or (heard is None and len(self._states) >= AXES):
            return False
        self._states[axis] = _Heard(state, now)
        self.clock_difference = state.clock - wall
        return True

    def take_event(self, event: Event) -> bool:
        """Store an event; return whether it is new."""
        return self._of_now(event.bridge) and self.log.take(event)

    def _of_now(self, run: str) -> bool:
        """Return whether a message belongs to the present run of the bridge; a message of a new run can begin that run."""
        if run == self.run:
            return True
        if self.run in self._bridges or (run in self._over and run not in self._bridges):
            return False  # of a second bridge, or of a run that has ended
        if self.run:
            self._over[self.run] = None
        while len(self._over) > _OVER:
            del self._over[next(iter(self._over))]
        self.run = run
        self._states.clear()
        self.info, self.informed = None, False
        self.log.begin(run)
        return True

    @property
    def settled(self) -> bool:
        """Whether the cell has reported its description, the state of each axis, and its events."""
        return self.informed and self.log.missing is None and not self.unheard

    @property
    def unheard(self) -> tuple[str, ...]:
        """The axes that have reported no state in this run of the bridge."""
        return tuple(axis for axis in self.axes if axis not in self._states)

    # -- known state ---------------------------------------------------------------------------------------------------

    @property
    def axes(self) -> tuple[str, ...]:
        """The names of the axes; in the order of the cell file if that is known."""
        told = tuple(axis.name for axis in self.info.axes) if self.info is not None else ()
        return told or tuple(sorted(self._states))

    def axis_info(self, axis: str) -> AxisInfo | None:
        """Return the description of an axis in its cell file; None if it is not known."""
        axes = () if self.info is None else self.info.axes
        return next((each for each in axes if each.name == axis), None)

    def seen(self, axis: str, now: float) -> LastAxisState | None:
        """Return the last state that an axis reported, None if it reported none in this run of its bridge."""
        heard = self._states.get(axis)
        if heard is None:
            return None
        age = None if heard.state.age is None else heard.state.age + (now - heard.at)
        known = age is not None and age <= FRESH and heard.state.state != UNKNOWN
        return LastAxisState(heard.state, age, self.alive and known)

    def rivals(self, now: float) -> bool:
        """Whether two bridges have used this name for longer than the token of a killed bridge can last."""
        return len(self._bridges) > 1 and now - max(self._bridges.values()) > _MISSED

    @property
    def bridged(self) -> bool:
        """Whether a bridge is present, even one that still waits for its machine."""
        return self.alive or bool(self._bridges)

    @property
    def differs(self) -> str:
        """How the cell's version of axisbus differs from the local one, as text for people; empty if it does not differ."""
        if self.info is None:
            return ""
        if self.info.protocol != PROTOCOL:
            return (
                f"axisbus {self.info.axisbus} speaks protocol {self.info.protocol}, "
                f"this one ({__version__}) protocol {PROTOCOL}"
            )
        return (
            f"axisbus {self.info.axisbus}, this one is {__version__}"
            if self.info.axisbus != __version__
            else ""
        )
