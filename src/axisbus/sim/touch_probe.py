"""Touch probe of one axis: two inputs, and the zero pulse, whose edges latch the true position of the motor at that moment.

``marks`` have positions of the motor (increments): an edge within a step latches the position of the mark, not the position at the
end of the step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import as_int32
from axisbus.sim.fault_injection import DriveFaults

RISING, FALLING = True, False  # the level after the edge
INPUTS = (1, 2)

_ENABLE, _CONTINUOUS, _ZERO_PULSE = 0x01, 0x02, 0x04
_SAMPLE = {RISING: 0x10, FALLING: 0x20}
_STORED = {RISING: 0x02, FALLING: 0x04}

Crossing = tuple[float, bool]


class TouchProbe:
    """60B8h to 60BDh and the edge counters of an axis, and the signals of its inputs.

    ``marks``: ranges of the motor's position (increments) in which an input is high. ``positions`` and ``counts`` have the format
    of the objects, by input (1 or 2) and edge.
    """

    def __init__(self, axis: Axis, dials: DriveFaults) -> None:
        self._axis = axis
        self._dials = dials
        self.marks: dict[int, list[tuple[float, float]]] = {number: [] for number in INPUTS}
        self._levels = dict.fromkeys(INPUTS, False)
        self.restart()

    def restart(self) -> None:
        """Power up: nothing is armed, nothing is latched."""
        self.function = self.status = 0
        self.positions = {(number, edge): 0 for number in INPUTS for edge in _SAMPLE}
        self.counts = dict(self.positions)

    def take(self, function: int) -> None:
        """Take 60B8h: an input that is switched off or on discards its latched edges."""
        before, self.function = self.function, function
        for number in INPUTS:
            self._arm(number, before >> 8 * (number - 1) & 0xFF, function >> 8 * (number - 1) & 0xFF)

    def _arm(self, number: int, before: int, bits: int) -> None:
        shown = self._shown(number)
        if not self._dials.probe_bits_stay:
            wanted = (
                bits if before & bits & _ENABLE else 0
            )  # if the input stays on, only edges no longer sampled are discarded
            shown &= sum(_STORED[edge] for edge, sample in _SAMPLE.items() if wanted & sample)
        on = bits & _ENABLE and not self._dials.probe_deaf
        self._show(number, shown & ~_ENABLE | (_ENABLE if on else 0))

    def _shown(self, number: int) -> int:
        return self.status >> 8 * (number - 1) & 0xFF

    def _show(self, number: int, bits: int) -> None:
        place = 8 * (number - 1)
        self.status = self.status & ~(0xFF << place) | bits << place

    # The signals.

    def put_mark(self, number: int, low: float, high: float) -> None:
        """Make input ``number`` high while the motor is between ``low`` and ``high``, in motor increments."""
        self.marks[number].append((low, high))

    def set_input(self, number: int, level: bool) -> None:
        """Set the level of input ``number`` (1 or 2) now: a change is an edge at the motor's position."""
        before, self._levels[number] = self._levels[number], level
        if level is not before and not self._by_zero_pulse(number):
            self._edge(number, level, self._axis.motor.position)

    def pass_over(self, before: float, after: float) -> None:
        """Process the edges of a motion from ``before`` to ``after``: at marks, or at the encoder's zero pulse."""
        if before == after:
            return
        for number in INPUTS:
            for place, edge in sorted(self._crossed(number, before, after), reverse=after < before):
                self._edge(number, edge, place)

    def _by_zero_pulse(self, number: int) -> bool:
        return bool(self.function >> 8 * (number - 1) & _ZERO_PULSE)

    def _crossed(self, number: int, before: float, after: float) -> Iterator[Crossing]:
        if self._by_zero_pulse(number):
            return self._zero_pulses(before, after)
        return _edges_of(self.marks[number], before, after)

    def _zero_pulses(self, before: float, after: float) -> Iterator[Crossing]:
        turn = float(self._axis.params.increments_per_turn)
        low, high = sorted((before, after))
        for count in range(math.ceil(low / turn), math.floor(high / turn) + 1):
            if count * turn != before:
                yield count * turn, RISING

    def _edge(self, number: int, edge: bool, position: float) -> None:
        bits, shown = self.function >> 8 * (number - 1) & 0xFF, self._shown(number)
        if not shown & _ENABLE or not bits & _SAMPLE[edge]:
            return
        if shown & _STORED[edge] and not bits & _CONTINUOUS:
            return
        self.positions[number, edge] = as_int32(round(self._axis.to_user(position)))
        self.counts[number, edge] = self.counts[number, edge] + 1 & 0xFFFF
        self._show(number, shown | _STORED[edge])


def _edges_of(marks: list[tuple[float, float]], before: float, after: float) -> Iterator[Crossing]:
    """Yield the positions at which a motor moving from ``before`` to ``after`` enters or leaves a mark."""
    for low, high in marks:
        if after > before:
            begins, ends = low, high
            rises, falls = before < low <= after, before <= high < after
        else:
            begins, ends = high, low
            rises, falls = before > high >= after, before >= low > after
        if rises:
            yield begins, RISING
        if falls:
            yield ends, FALLING
