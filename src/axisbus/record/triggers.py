"""Parse a trigger: ``part = true`` of an input, ``x.probe`` of a touch probe, otherwise a condition on values of axes."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from axisbus.cia301.frame import CanFrame
from axisbus.cia401.port import SignalValidity
from axisbus.cia401.signal import IoPoint
from axisbus.errors import ArgumentError
from axisbus.motion.numbers import short_repr
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState
from axisbus.record.columns import COLUMNS, NAMES, AxisForm
from axisbus.record.condition import Condition, Values, comparison, condition
from axisbus.record.events import Watched
from axisbus.record.objects import MappedSignal, WantedObject, mapped_signal, wanted_object
from axisbus.record.sample_packing import sample_of
from axisbus.session import MachineSession

_IO = re.compile(r"(?P<bar>\|?)\s*(?P<name>[^\s.|<>=!]+)\s*\|?\s*(?P<sign>[<>]=?|!=|==?)\s*(?P<value>.+)")
_PROBE = re.compile(r"(?P<axis>[^\s.|]+)\.probe")


class RecordingTrigger:
    """Evaluate each cycle, and report the time of the trigger. A condition that is true from the beginning does not fire."""

    def begin(self) -> None:
        """Start observing."""

    def end(self) -> None:
        """Stop observing; harmless when repeated."""

    def seen(self, now: float, snapshots: Mapping[str, Snapshot]) -> float | None:
        """Return the time of the trigger (s, monotonic), at the latest that of the cycle at ``now``; None: not yet."""
        raise NotImplementedError


def trigger_of(when: str | Condition, machine: Watched, forms: Mapping[str, AxisForm]) -> RecordingTrigger:
    """Return the trigger for ``when``; ``forms``: those of the observed axes.

    Raises:
        ArgumentError: the text is invalid, or names an unknown axis, value, input or output.
        StateError: the node of the input or output is absent.
    """
    if callable(when):
        return Trigger(when, forms)
    if not isinstance(when, str):
        raise ArgumentError(
            f"{short_repr(when)} is not a condition",
            remedy='give a text such as "x.velocity > 100" or "fault", or a function of the axes\' values',
        )
    text = when.strip()
    if probe := _PROBE.fullmatch(text):
        return ProbeTrigger(_axis(text, probe["axis"], forms))
    found = _IO.fullmatch(text)
    if found is None:
        return Trigger(text, forms)
    return _of_io(text, found, machine)


def _axis(text: str, name: str, forms: Mapping[str, AxisForm]) -> str:
    if name not in forms:
        raise ArgumentError(f"{text!r}: there is no axis {name!r}", observed=f"there are {', '.join(forms)}")
    return name


def _of_io(text: str, found: re.Match[str], machine: Watched) -> RecordingTrigger:
    name = found["name"]
    if name not in machine.cell.io:
        there = ", ".join(machine.cell.io) or "none"
        raise ArgumentError(
            f"{text!r} is not a condition: there is no input or output {name!r}",
            observed=f"the cell has {there}",
            remedy=EXAMPLES,
        )
    wanted = wanted_object(machine, name)
    assert wanted.point is not None
    met = comparison(text, found, _kind(wanted.point), EXAMPLES)
    return IoTrigger(machine.session, wanted, lambda: mapped_signal(machine, wanted), met)


def _kind(point: IoPoint) -> str:
    """Return the JSON type of its values."""
    if point.bit is not None:
        return "boolean"
    return "integer" if point.scale is None else "number"


# -- The trigger of a capture: a condition on the values of an axis, in its units, or a fault of any axis --------------
#
# Examples: ``x.velocity > 100``, ``|x.following_error| > 0.5``, ``x.state = ErrorStop``, ``x.mode = csp``, ``fault``. The trigger
# fires when the condition becomes true; a condition that is true from the beginning must first become false.


_FAULT = "fault"
_KINDS = {column.name: column.type for column in COLUMNS}
EXAMPLES = (
    "write it as 'x.velocity > 100', '|x.following_error| > 0.5', 'x.state = ErrorStop', 'fault', 'x.probe', "
    "or of an input or output as 'part = true'"
)


class Trigger(RecordingTrigger):
    """Evaluate each cycle; holds whether the condition was true in the previous one."""

    def __init__(self, when: str | Condition, forms: Mapping[str, AxisForm]) -> None:
        """``when``: as above, or a function of the values of all axes; ``forms``: those of the present axes.

        Raises:
            ArgumentError: the text is not a condition, or names an axis or value that is not recorded.
        """
        self._forms = forms
        self._condition = (
            _fault if when == _FAULT else when if callable(when) else condition(when, forms, _KINDS, EXAMPLES)
        )
        self._before = True

    def seen(self, now: float, snapshots: Mapping[str, Snapshot]) -> float | None:
        """As ``RecordingTrigger.seen``: the cycle in which the condition became true; raises the errors of a user's function."""
        values = {
            name: dict(zip(NAMES, form.values(sample_of(snapshots[name])), strict=True))
            for name, form in self._forms.items()
        }
        holds = bool(self._condition(values))
        rises, self._before = holds and not self._before, holds
        return now if rises else None


def _fault(values: Values) -> bool:
    return any(axis["state"] == AxisState.ERRORSTOP.value for axis in values.values())


# -- Trigger a capture on an edge of a named input or output, or when its value crosses a limit ------------------------
#
# Theory of operation
# If a PDO carries the signal, each of its frames is evaluated when it is received or sent, so that an edge has the time of its
# frame, and no pulse between two cycles is lost. Without a bus, or if no PDO carries the signal, the value of each cycle is
# evaluated. While the signal is unknown (its node is lost), it has no value: its first value afterwards is a new starting point,
# not an edge.


_MOST = 16  # the most triggers waiting for their cycle: the first one counts


class IoTrigger(RecordingTrigger):
    """Hold whether the condition was last true (None: unknown), and the trigger times from frames."""

    def __init__(
        self,
        session: MachineSession,
        wanted: WantedObject,
        locate: Callable[[], MappedSignal | None],
        met: Callable[[Any], bool],
    ) -> None:
        """``locate`` returns the present location of ``wanted`` in a PDO; ``met`` whether a value meets the condition."""
        self._session = session
        self._wanted = wanted
        self._locate = locate
        self._signal = locate()
        self._met = met
        self._before: bool | None = None
        self._found: deque[float] = deque(maxlen=_MOST)
        self._since: float | None = None  # the first cycle: earlier ones are not in the file
        self._tapped = self._signal is not None and session.carried is not None

    def begin(self) -> None:
        """As ``RecordingTrigger.begin``."""
        self._before = self._now()
        if self._signal is not None and self._tapped:
            self._session.tap(self._on_frames, (self._signal.carried.can_id,))

    def end(self) -> None:
        """As ``RecordingTrigger.end``."""
        if self._tapped:
            self._tapped = False
            self._session.untap(self._on_frames)

    def seen(self, now: float, _snapshots: Mapping[str, Snapshot]) -> float | None:
        """As ``RecordingTrigger.seen``: the time of the frame, or of the cycle if there is no frame."""
        self._locate_again()
        found = self._now()
        self._since = now if self._since is None else self._since
        while self._found and self._found[0] < self._since:
            self._found.popleft()
        if found is None or self._before is None:
            self._before = found
        elif not self._tapped and self._rises(found):
            return now
        return self._found.popleft() if self._found and self._found[0] <= now else None

    def _locate_again(self) -> None:
        """Find the place again: a boot-up in a running machine may change it. The condition must then become false first."""
        signal = self._locate()
        if signal != self._signal:
            self.end()
            self._signal, self._tapped = signal, signal is not None and self._session.carried is not None
            self._found.clear()
            self.begin()

    def _on_frames(self, frames: Sequence[CanFrame]) -> None:
        assert self._signal is not None
        for frame in frames:
            value = None if frame.remote else self._signal.value(frame.data)
            if value is not None and self._rises(self._met(value)):
                self._found.append(frame.time)

    def _rises(self, now: bool) -> bool:
        before, self._before = self._before, now
        return before is False and now

    def _now(self) -> bool | None:
        """Return whether the condition is true in the last cycle; None if the value is unknown."""
        reading = self._session.readings.get(self._wanted.label)
        if reading is None or reading.known is not SignalValidity.YES or reading.value is None:
            return None
        assert self._wanted.point is not None
        return self._met(self._wanted.point.shown(reading.value))


# -- Trigger a capture on an edge latched by a touch probe -------------------------------------------------------------


class ProbeTrigger(RecordingTrigger):
    """Hold the number of edges that the axis had latched in the previous cycle; counts edges reported to any program."""

    def __init__(self, axis: str) -> None:
        self._axis = axis
        self._before: int | None = None

    def seen(self, now: float, snapshots: Mapping[str, Snapshot]) -> float | None:
        """As ``RecordingTrigger.seen``: the cycle that saw the edge, as ``ProbeResult.time``; the edge itself was earlier."""
        latched, before = snapshots[self._axis].latched, self._before
        self._before = latched
        return now if before is not None and latched > before else None
