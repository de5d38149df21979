"""The public touch probe: requests, and the latched positions in the axis's unit."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from axisbus.cia402 import objects
from axisbus.cia402.port import Waiter
from axisbus.cia402.touch_probe import INPUTS, POSITIONS, Edge, ProbeSource
from axisbus.errors import ArgumentError, StateError
from axisbus.machine.handle import Handle, mark_end_as_read, timeout_seconds
from axisbus.machine.request import AxisCall, flag_of
from axisbus.motion.command_status import ProbeCapture, Status
from axisbus.motion.commands import Probe
from axisbus.motion.moves.activity import object_text
from axisbus.motion.numbers import short_repr
from axisbus.motion.parameters import AxisParameters, Units
from axisbus.session import CommandEvent

_KEPT = 10_000  # captures of one handle
_EDGES = {
    "rising": frozenset({Edge.RISING}),
    "falling": frozenset({Edge.FALLING}),
    "both": frozenset(Edge),
}
_SOURCES = {source.value: source for source in ProbeSource}
_T = TypeVar("_T")
_keys = itertools.count(1)


@dataclass(frozen=True, slots=True)
class ProbeResult:
    """One edge: the position that the drive latched, in the axis's unit.

    ``position`` is wrapped as ``axis.position`` was in the cycle in which the edge was seen; ``unwrapped`` is not wrapped at
    ``modulo``. ``edge``: "rising" or "falling". ``time``: seconds (monotonic, as ``axis.snapshot.now``) of that cycle; the edge
    itself was earlier. ``missed``: the number of edges of this kind that the drive has counted since the previous result and that
    were not reported; None if the drive does not count.
    """

    position: float
    unwrapped: float
    edge: str
    time: float
    missed: int | None


class ProbeHandle(Handle):
    """A request to a touch probe. ``active``: its input is armed. ``done``: all requested edges are latched.

    The last 10,000 captures are stored. In a ``with`` block the input is switched off at the end.
    """

    __slots__ = ("_abort", "_all", "_new", "_units")

    def __init__(self, name: str, waiter: Waiter, units: Units, abort: Callable[[], Handle]) -> None:
        super().__init__(name, waiter)
        self._units = units
        self._abort = abort
        self._all: deque[ProbeResult] = deque(maxlen=_KEPT)
        self._new: deque[ProbeResult] = deque(maxlen=_KEPT)

    def _on_event(self, event: CommandEvent) -> None:
        """As ``Handle._on_event``, and store the captured position."""
        if event.capture is not None and self.busy:
            probed = _probed(event.capture, self._units)
            self._all.append(probed)
            self._new.append(probed)
        super()._on_event(event)

    @property
    def captures(self) -> tuple[ProbeResult, ...]:
        """All captures so far, oldest first."""
        return tuple(self._all)

    @property
    def result(self) -> ProbeResult:
        """The last capture.

        Raises:
            StateError: no edge has been captured.
        """
        try:
            return self._all[-1]
        except IndexError:
            raise StateError(
                f"{self.name}: no edge was seen",
                observed=f"the request is {self.status.value}" if self.error is None else self.error.message,
                remedy="wait for the edge before you read its position",
            ) from None

    @property
    def position(self) -> float:
        """Position of the axis at the last captured edge, in its unit; raises as ``result``."""
        return self.result.position

    def wait_armed(self, timeout: float | None = None) -> ProbeHandle:
        """Block until the input is armed, at most ``timeout`` seconds; return the handle. An earlier edge is not latched.

        Raises:
            TimeoutError: the input is not armed yet; the request continues.
            AxisbusError: the error that ended the request.
        """
        self._wait_for(lambda: self.status is not Status.BUSY, timeout, "not armed")
        if self.status in (Status.ABORTED, Status.ERROR):
            self.wait(0)
        return self

    def next(self, timeout: float | None = None) -> ProbeResult:
        """Return the oldest capture that ``next`` has not returned yet; block for it at most ``timeout`` seconds.

        Raises:
            TimeoutError: there was none; the request continues.
            StateError: the request has ended, and there will be no more.
            AxisbusError: the error that ended the request.
        """
        self._wait_for(lambda: bool(self._new) or not self.busy, timeout, "no edge")
        if self._new:
            return self._new.popleft()
        self.wait(0)
        raise StateError(
            f"{self.name}: the request has ended, and there are no more edges", remedy="request another probe"
        )

    def cancel(self) -> Handle:
        """Switch the input off, if this request still uses it. Does not block; the returned handle is done when the input is off.

        This request ends as aborted.
        """
        return self._abort()

    def __enter__(self) -> ProbeHandle:
        return self

    def __exit__(self, *_: object) -> None:
        if self.busy:
            # if the node is lost or the machine is closed, this request has reported the reason
            mark_end_as_read(self.cancel())

    def _wait_for(self, happened: Callable[[], bool], timeout: float | None, what: str) -> None:
        if not self._waiter.wait(happened, timeout_seconds(self.name, timeout)):
            raise TimeoutError(f"{self.name}: {what} after {timeout:g} s; the request continues")


def _probed(capture: ProbeCapture, units: Units) -> ProbeResult:
    place = units.position.to_units(capture.position - capture.origin)
    return ProbeResult(units.turned(place), place, capture.edge.value, capture.stamp, capture.missed)


def input_number(request: AxisCall, number: object) -> int:
    """Return the number of an input; raises ArgumentError."""
    if isinstance(number, bool) or not isinstance(number, int) or number not in INPUTS:
        raise ArgumentError(
            f"{request.text}: a touch probe has the inputs 1 and 2", observed=f"input is {short_repr(number)}"
        )
    return number


def probe_command(
    request: AxisCall,
    parameters: AxisParameters,
    number: int,
    edge: str,
    source: str,
    window: tuple[float, float] | None,
    *,
    continuous: bool,
) -> Probe:
    """Return the command for a touch probe.

    Raises:
        ArgumentError: a value is not one of those allowed.
        StateError: the drive lacks an object that is needed.
    """
    number = input_number(request, number)
    edges = _choice(request, "edge", edge, _EDGES)
    signal = _choice(request, "source", source, _SOURCES)
    if signal is ProbeSource.ZERO_PULSE and edges != _EDGES["rising"]:
        raise ArgumentError(
            f"{request.text}: the zero pulse has one edge", remedy='leave edge out, or give "rising"'
        )
    require_objects(request, parameters, number, edges)
    within = _window(request, window, endless=parameters.units.modulo is not None)
    return Probe(number, edges, signal, flag_of(request.text, "continuous", continuous), within, next(_keys))


def require_objects(
    request: AxisCall, parameters: AxisParameters, number: int, edges: frozenset[Edge]
) -> None:
    """Raise StateError if the EDS lacks a touch probe object; if ``edges`` is empty, only the objects to switch it off count."""
    wanted = [objects.TOUCH_PROBE_FUNCTION, objects.TOUCH_PROBE_STATUS]
    wanted += [POSITIONS[number, edge] for edge in Edge if edge in edges]
    missing = next((index for index in wanted if not parameters.has(index)), None)
    if missing is None:
        return
    if parameters.virtual:
        raise StateError(
            f"{request.text}: a virtual axis has no touch probe", remedy="probe an axis that has a drive"
        )
    raise StateError(
        f"{request.text}: the drive has no {object_text(missing)}",
        observed=f"it is not in {parameters.eds or 'its EDS'}",
        remedy=f"if the drive of node {parameters.node} has it, name the drive's own EDS in cell.toml; otherwise wire the "
        "signal to another input, or use another method to measure",
    )


def _choice(request: AxisCall, what: str, given: object, choices: dict[str, _T]) -> _T:
    found = choices.get(given) if isinstance(given, str) else None
    if found is None:
        known = ", ".join(f'"{name}"' for name in choices)
        raise ArgumentError(
            f"{request.text}: {what} must be one of {known}", observed=f"it is {short_repr(given)}"
        )
    return found


def _window(request: AxisCall, window: object, *, endless: bool) -> tuple[float, float] | None:
    if window is None:
        return None
    if not isinstance(window, tuple | list) or len(window) != 2:
        raise ArgumentError(
            f"{request.text}: window must be two positions",
            observed=f"it is {short_repr(window)}",
            remedy="give two numbers",
        )
    low, high = (request.finite("window", edge) for edge in window)
    if not endless and low > high:
        raise ArgumentError(
            f"{request.text}: the window ends before it begins", remedy="give the lower position first"
        )
    return low, high
