"""One request for one input of a touch probe: switched off, confirmed clear, armed, polled, read, and switched off again.

Theory of operation
-------------------
A bit of 60B9h may belong to an old edge. So the input is switched off first, and armed after 60B9h has shown none of its bits: any
bit set from then on belongs to a later edge. A latched position is read after its bit was seen.

If the input is armed for the first edge only, the drive keeps the latched position, so one reading is enough. If it is armed
continuously, the drive may latch the next edge between two answers. With an edge counter (60D5h to 60D8h), the position is valid if
the counter was the same before and after it. Without a counter, a position belongs to a new edge if it differs from the one read
last (see ``latch``). Bits 6 and 7, which toggle in some drives, are vendor-specific in the standard, and prove nothing. The master
checks a window, so the drive is armed continuously for it.

One transfer runs at a time: ``_OBJECT_OF`` gives the object of each step, ``_ON_ANSWER`` the function that processes the answer and
selects the next step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum, auto
from typing import NamedTuple

from axisbus.cia402 import objects
from axisbus.cia402.touch_probe import (
    CONTINUOUS,
    COUNTERS,
    ENABLED,
    IN_USE,
    POSITIONS,
    STORED,
    Edge,
    byte_of,
    function_bits,
    with_byte,
)
from axisbus.errors import ProbeError, StaleError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.command_status import ProbeCapture
from axisbus.motion.commands import Probe
from axisbus.motion.moves.activity import unknown_position
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.probing.sdo_sequence import SdoExchange

POLL = 0.01  # seconds between two polls of 60B9h
_CONFIRM_TIME = 1.0  # seconds within which 60B9h must follow 60B8h


# -- The position window within which an edge of a touch probe counts --------------------------------------------------


Window = tuple[float, float]


def is_within(position: float, window: Window | None, modulo: float | None) -> bool:
    """Return whether a position is in ``window`` (in the axis's unit); for a modulo axis the window may cross a turn's end."""
    if window is None:
        return True
    low, high = window
    if modulo is None:
        return low <= position <= high
    return (position - low) % modulo <= (high - low) % modulo


# -- The steps of one input --------------------------------------------------------------------------------------------


class ArmingStep(Enum):
    """The next step of a request."""

    READ_FUNCTION = (
        auto()
    )  # read 60B8h, because the bits of the other input and of the vendor must not change
    CLEAR = auto()
    CONFIRM_CLEAR = auto()
    ARM = auto()
    CONFIRM_ARMED = auto()
    POLLING = auto()
    READ = auto()
    SWITCH_OFF = auto()
    OVER = auto()


_FUNCTION, _STATUS = objects.TOUCH_PROBE_FUNCTION, objects.TOUCH_PROBE_STATUS
_OBJECT_OF = {
    ArmingStep.READ_FUNCTION: _FUNCTION,
    ArmingStep.CLEAR: _FUNCTION,
    ArmingStep.CONFIRM_CLEAR: _STATUS,
    ArmingStep.ARM: _FUNCTION,
    ArmingStep.CONFIRM_ARMED: _STATUS,
    ArmingStep.POLLING: _STATUS,
    ArmingStep.SWITCH_OFF: _FUNCTION,
}


class Arming:
    """The state of one request; without I/O of its own. ``armed``, ``captures`` and ``fulfilled`` are valid after each ``step``."""

    def __init__(
        self, number: int, command: Probe | None, parameters: AxisParameters, function: ProbeFunction
    ) -> None:
        """``number``: input 1 or 2; ``command`` None: the input is only switched off."""
        self.armed = False
        self.captures: list[ProbeCapture] = []  # of this cycle
        self.last_poll = -math.inf  # when the last poll of 60B9h without a new edge began
        self._requested_at = -math.inf
        self._number, self._command = number, command
        self._parameters = parameters
        self._function = function
        self._exchange = SdoExchange(parameters)
        self._step = ArmingStep.READ_FUNCTION if function.word is None else ArmingStep.CLEAR
        self._due = self._until = 0.0
        self._missing: set[Edge] = set() if command is None else set(command.edges)
        self._bits = 0 if command is None else _bits_of(command)
        self._latches = {edge: self._latch(edge) for edge in self._missing}
        self._reading: list[Edge] = []

    @property
    def fulfilled(self) -> bool:
        """Whether every requested edge was reported."""
        return not self._missing

    @property
    def over(self) -> bool:
        """Whether the input is switched off."""
        return self._step is ArmingStep.OVER

    def step(self, image: AxisImage, order: CycleOutputs) -> None:
        """Advance by one cycle.

        Raises:
            DriveError: the drive aborts a transfer, or does not answer.
            ProbeError: the drive does not do what was written.
            StaleError: the axis position is unknown.
        """
        self.captures = []
        exchange = self._exchange
        if exchange.is_active:
            reply = exchange.step(image, order)
            if reply is None:
                return
            _ON_ANSWER[self._step](self, reply.value or 0, image)
        if self._step is not ArmingStep.OVER and not exchange.is_active and image.now >= self._due:
            self._send_request(image, order)

    def switch_off(self, order: CycleOutputs) -> None:
        """Drop the request, and switch the input off."""
        self._exchange.cancel(order)
        self._missing, self._bits, self._due = set(), 0, 0.0
        self._step = ArmingStep.READ_FUNCTION if self._function.word is None else ArmingStep.SWITCH_OFF

    def drop(self, order: CycleOutputs) -> None:
        """Cancel the active transfer."""
        self._exchange.cancel(order)

    def _latch(self, edge: Edge) -> Latch:
        counter = COUNTERS[self._number, edge]
        counted = self._bits & CONTINUOUS and self._parameters.has(counter)
        return Latch(POSITIONS[self._number, edge], counter if counted else None)

    def _send_request(self, image: AxisImage, order: CycleOutputs) -> None:
        index = (
            self._latches[self._reading[0]].next_object
            if self._step is ArmingStep.READ
            else _OBJECT_OF[self._step]
        )
        writes = index == _FUNCTION and self._step is not ArmingStep.READ_FUNCTION
        self._requested_at = image.now
        self._exchange.begin(index, self._word if writes else None, image, order)

    def _word(self) -> int:
        return self._function.set(self._number, self._bits if self._step is ArmingStep.ARM else 0)

    # -- answers of the drive ------------------------------------------------------------------------------------------

    def _on_function_read(self, value: int, _: AxisImage) -> None:
        if self._function.word is None:
            self._function.word = value
        self._step = ArmingStep.CLEAR

    def _on_cleared(self, _: int, image: AxisImage) -> None:
        self._step = ArmingStep.OVER if not self._bits else ArmingStep.CONFIRM_CLEAR
        self._until = image.now + _CONFIRM_TIME

    def _on_clear_check(self, value: int, image: AxisImage) -> None:
        bits = byte_of(value, self._number) & IN_USE
        if not bits:
            self._step = ArmingStep.ARM
            return
        self._wait(
            image,
            f"60B9h is still {value:04X}h",
            "it does not clear its previous latched position when it is switched off",
        )

    def _on_armed(self, _: int, image: AxisImage) -> None:
        self._step, self._until = ArmingStep.CONFIRM_ARMED, image.now + _CONFIRM_TIME

    def _on_armed_check(self, value: int, image: AxisImage) -> None:
        if not byte_of(value, self._number) & IN_USE:
            self._wait(image, f"60B9h is {value:04X}h", "it does not show that it is armed")
            return
        self.armed, self._step = True, ArmingStep.POLLING
        self._on_poll(value, image)

    def _on_poll(self, value: int, image: AxisImage) -> None:
        bits = byte_of(value, self._number)
        self._reading = [edge for edge in Edge if edge in self._missing and bits & STORED[edge]]
        if not bits & ENABLED and (not self._reading or self._bits & CONTINUOUS):
            raise self._failure(
                "it is no longer armed, and this program has not switched it off", f"60B9h is {value:04X}h"
            )
        self._due = image.now if self._reading else image.now + POLL
        if not self._reading:
            self.last_poll = self._requested_at
        else:
            self._step = ArmingStep.READ
            self._latches[self._reading[0]].begin()

    def _on_position_read(self, value: int, image: AxisImage) -> None:
        edge = self._reading[0]
        latch = self._latches[edge]
        latched = latch.take(value)
        if latched is not None:
            self._report(edge, latched, image)
        if not latch.over:
            return
        self._reading.pop(0)
        if self._reading:
            self._latches[self._reading[0]].begin()
        else:
            self._step, self._due = ArmingStep.POLLING, image.now + POLL

    def _on_switched_off(self, _: int, __: AxisImage) -> None:
        self._step = ArmingStep.OVER

    def _report(self, edge: Edge, latched: Latched, image: AxisImage) -> None:
        assert self._command is not None
        position = image.unwrapped(latched.raw)
        if position is None:
            raise self._unknown_position(image)
        units = self._parameters.units
        in_units = units.position.to_units(position - image.origin)
        if not is_within(in_units, self._command.window, units.modulo):
            return
        self.captures.append(ProbeCapture(edge, position, image.origin, image.now, latched.missed))
        if not self._command.continuous:
            self._missing.discard(edge)

    def _wait(self, image: AxisImage, observed: str, failure: str) -> None:
        """Poll again later; raise ProbeError if this has lasted too long."""
        if image.now > self._until:
            raise self._failure(failure, f"{observed}, {_CONFIRM_TIME:g} s after 60B8h was written")
        self._due = image.now + POLL

    def _failure(self, what: str, observed: str) -> ProbeError:
        name = self._parameters.name
        return ProbeError(
            f"{name}: touch probe {self._number}: {what}",
            axis=name,
            observed=observed,
            remedy="see the drive's manual for the requirements of its touch probe; make sure that no RPDO carries 60B8h, "
            "and that no other program or tool writes it",
        )

    def _unknown_position(self, image: AxisImage) -> StaleError:
        name = self._parameters.name
        return unknown_position(
            image,
            name,
            f"{name}: touch probe {self._number} has latched a position, which cannot be used: the actual position (6064h) "
            "is unknown",
            "check cable and bus load, and that the drive still sends the TPDO that contains 6064h (axisbus monitor)",
        )


def _bits_of(command: Probe) -> int:
    continuous = command.continuous or command.window is not None
    return function_bits(command.edges, command.source, continuous=continuous)


# ----------------------------------------------------------------------------------------------------------------------
# Read a latched position of one edge of a touch probe until it is known to belong to an edge that was not reported yet.


_TRIES = 3  # faster edges are counted as missed, and not reported


class Latched(NamedTuple):
    """A position as the drive reports it, and the number of edges missed before it (None: the drive does not count edges)."""

    raw: int
    missed: int | None


class Latch:
    """Holds the values that were read last, and the state of the present reading."""

    __slots__ = ("_before", "_counter", "_last_count", "_last_raw", "_position", "_raw", "_tries", "over")

    def __init__(self, position: int, counter: int | None) -> None:
        """``position`` and ``counter`` are object indices; counter None: a position is new if it differs from the last one."""
        self._position, self._counter = position, counter
        self._last_count: int | None = None
        self._last_raw: int | None = None
        self.begin()

    def begin(self) -> None:
        """Begin a reading, because the edge's bit is set."""
        self._before: int | None = None
        self._raw: int | None = None
        self._tries = 0
        self.over = False

    @property
    def next_object(self) -> int:
        """The index of the object to read next."""
        if self._counter is None or (self._before is not None and self._raw is None):
            return self._position
        return self._counter

    def take(self, value: int) -> Latched | None:
        """Process a value that was read; return a new position. ``over``: nothing more needs to be read."""
        if self._counter is None:
            self.over = True
            new = value != self._last_raw
            self._last_raw = value
            return Latched(value, None) if new else None
        if self._before is None:
            self._before, self.over = value, value == self._last_count
        elif self._raw is None:
            self._raw = value
        elif value == self._before:
            return self._counted(value, self._raw)
        else:  # another edge came in between, so the position cannot be attributed to an edge
            self._before, self._raw = value, None
            self._tries += 1
            self.over = self._tries >= _TRIES
        return None

    def _counted(self, count: int, raw: int) -> Latched:
        missed = 0 if self._last_count is None else (count - self._last_count - 1) & 0xFFFF
        self._last_count, self.over = count, True
        return Latched(raw, missed)


# -- The touch probe function (60B8h) of an axis, which its two inputs share -------------------------------------------


class ProbeFunction:
    """Holds the value of 60B8h that was written or read last; None: it must be read first."""

    __slots__ = ("word",)

    def __init__(self) -> None:
        self.word: int | None = None

    def set(self, number: int, bits: int) -> int:
        """Return the word with ``bits`` for input ``number`` and all other bits unchanged, and store it."""
        self.word = with_byte(self.word or 0, number, bits)
        return self.word


# -- What each step does -----------------------------------------------------------------------------------------------


_ON_ANSWER: dict[ArmingStep, Callable[[Arming, int, AxisImage], None]] = {
    ArmingStep.READ_FUNCTION: Arming._on_function_read,
    ArmingStep.CLEAR: Arming._on_cleared,
    ArmingStep.CONFIRM_CLEAR: Arming._on_clear_check,
    ArmingStep.ARM: Arming._on_armed,
    ArmingStep.CONFIRM_ARMED: Arming._on_armed_check,
    ArmingStep.POLLING: Arming._on_poll,
    ArmingStep.READ: Arming._on_position_read,
    ArmingStep.SWITCH_OFF: Arming._on_switched_off,
}
