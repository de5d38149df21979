"""What is known of a cell by the messages that came, and by the local time at which they came; nothing here has a clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from axisbus.fleet.events import EventLog
from axisbus.fleet.messages import PROTOCOL, AxisInfo, AxisStateMessage, CellInfo, Event
from axisbus.version import __version__

FRESH = 1.0  # seconds: what is older is not known any more
UNKNOWN = "unknown"  # the state of an axis of which nothing is known
AXES = 256  # that a cell may have
_OVER = 100  # runs of which it is kept that they are over
_MISSED = 2.0  # seconds in which the token of a bridge that was killed is gone for sure


class LastAxisState(NamedTuple):
    """What an axis told last; ``age``: how old it is now (s), None where nothing is known; ``fresh``: whether it holds now."""

    state: AxisStateMessage
    age: float | None
    fresh: bool


@dataclass(frozen=True, slots=True)
class _Heard:
    state: AxisStateMessage
    at: float


class CellWatch:
    """One cell as its messages tell it. All times are seconds of the local monotonic clock, given by the caller.

    A run of a bridge that another one has followed is over: what comes of it is late. Of two that are there at a time the one that
    was heard first counts; where both stay for longer than one that was killed is missed in, two bridges have one name.
    """

    def __init__(self, name: str, now: float) -> None:
        self.name = name
        self.alive = False
        self.since = now  # when it was seen to come or go
        self.info: CellInfo | None = None
        self.informed = False  # whether that is of the machine that runs now
        self.run = ""  # of the bridge that tells
        self.log = EventLog()
        self.clock_difference: float | None = None
        self._states: dict[str, _Heard] = {}
        self._over: dict[str, None] = {}  # runs that are over, the oldest first
        self._bridges: dict[str, float] = {}  # those that are there, and since when

    # -- what comes ----------------------------------------------------------------------------------------------------

    def token(self, there: bool, now: float) -> None:
        """Its liveliness token has come, or gone."""
        if there != self.alive:
            self.alive, self.since = there, now
            self.informed = False  # it may be another machine, of another text of the cell file
            self.log.doubt()

    def presence(self, bridge: str, there: bool, now: float) -> None:
        """A bridge of this name has come, or gone."""
        if not there:
            self._bridges.pop(bridge, None)
        else:
            self._bridges.setdefault(bridge, now)

    def take_info(self, info: CellInfo, wall: float) -> bool:
        """Take in what the cell is; return whether that counts (it does not come of a run that is over)."""
        if not self._of_now(info.bridge):
            return False
        self.info, self.informed = info, True
        self.clock_difference = info.clock - wall
        return True

    def take_state(self, axis: str, state: AxisStateMessage, now: float, wall: float) -> bool:
        """Take in what an axis does; return whether it is newer than what is here."""
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
        """Take in what has happened; return whether it is new."""
        return self._of_now(event.bridge) and self.log.take(event)

    def _of_now(self, run: str) -> bool:
        """Return whether a message is of the present run of the bridge, which it may begin."""
        if run == self.run:
            return True
        if self.run in self._bridges or (run in self._over and run not in self._bridges):
            return False  # of a second bridge, of one that has ended, or of nobody that is there
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
        """Whether it has told what it is, what each axis does, and what has happened."""
        return self.informed and self.log.missing is None and not self.unheard

    @property
    def unheard(self) -> tuple[str, ...]:
        """The axes that have told nothing in this run of the bridge."""
        return tuple(axis for axis in self.axes if axis not in self._states)

    # -- what is known -------------------------------------------------------------------------------------------------

    @property
    def axes(self) -> tuple[str, ...]:
        """The names of its axes, in the order of its cell file where that is known."""
        told = tuple(axis.name for axis in self.info.axes) if self.info is not None else ()
        return told or tuple(sorted(self._states))

    def axis_info(self, axis: str) -> AxisInfo | None:
        """Return what its cell file says of an axis; None where that is not known."""
        axes = () if self.info is None else self.info.axes
        return next((each for each in axes if each.name == axis), None)

    def seen(self, axis: str, now: float) -> LastAxisState | None:
        """Return what an axis told last, None where it told nothing in this run of its bridge."""
        heard = self._states.get(axis)
        if heard is None:
            return None
        age = None if heard.state.age is None else heard.state.age + (now - heard.at)
        known = age is not None and age <= FRESH and heard.state.state != UNKNOWN
        return LastAxisState(heard.state, age, self.alive and known)

    def rivals(self, now: float) -> bool:
        """Whether two bridges have this name, for longer than one that was killed is missed in."""
        return len(self._bridges) > 1 and now - max(self._bridges.values()) > _MISSED

    @property
    def bridged(self) -> bool:
        """Whether a bridge is there, be it that it waits for its machine."""
        return self.alive or bool(self._bridges)

    @property
    def differs(self) -> str:
        """How its version differs from this one, for people; empty where it does not."""
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
