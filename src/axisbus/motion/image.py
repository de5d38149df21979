"""What is known of a drive in one cycle: fresh values or None, the power-stage state, and whether the axis stands."""

from __future__ import annotations

import math

from axisbus.cia301.emcy import Emcy
from axisbus.cia402.port import Capabilities, Inputs, Sample, SdoReply
from axisbus.cia402.starvation import Starvation
from axisbus.cia402.state import State, decode
from axisbus.errors import BusError
from axisbus.units import INT32_HALF, INT32_SPAN


class Image:
    """The decoded inputs of one axis; holds state: the unwrapped position and the anchor of the standstill test.

    A value older than its maximum age, or never received, is None: *unknown*. Positions are unwrapped increments (they go on past
    the wrap of INTEGER32). ``origin`` is the position that the user calls 0 (set by ``set_position``).
    """

    __slots__ = (
        "_anchor",
        "_anchor_stamp",
        "_max_age",
        "_period",
        "_raw_position",
        "_tolerance",
        "_window",
        "bus",
        "demand",
        "emcy",
        "gap",
        "mode",
        "nmt",
        "now",
        "operational",
        "origin",
        "position",
        "position_stamp",
        "replies",
        "standstill",
        "starvation",
        "state",
        "statusword",
        "statusword_stamp",
        "torque",
        "velocity",
    )

    def __init__(self, capabilities: Capabilities, period: float, tolerance: float, window: float) -> None:
        """``period``: of the scan, in seconds; ``tolerance``: increments that a standing axis may wander within ``window`` s."""
        ages = capabilities.max_age
        self._max_age = tuple(
            ages.get(name, math.inf)
            for name in ("statusword", "mode", "position", "velocity", "torque", "demand")
        )
        self._period = period
        self._tolerance = tolerance
        self._window = window
        self._anchor: int | None = None
        self._anchor_stamp = -math.inf
        self._raw_position: int | None = None
        self.now = -math.inf
        self.gap = 0.0  # seconds since the cycle before
        self.origin = 0
        self.operational = False
        self.nmt = -1
        self.bus: BusError | None = None
        self.statusword: int | None = None
        self.statusword_stamp = -math.inf
        self.state = State.UNKNOWN
        self.mode: int | None = None
        self.position: int | None = None
        self.position_stamp = -math.inf
        self.velocity: int | None = None
        self.torque: int | None = None
        self.demand: int | None = None
        self.standstill = False
        self.starvation = Starvation()
        self.replies: dict[int, SdoReply] = {}
        self.emcy: tuple[Emcy, ...] = ()

    def update(self, inputs: Inputs) -> None:
        """Take the inputs of this cycle."""
        now, ages = inputs.now, self._max_age
        self.gap = now - self.now
        self.now = now
        if self.gap >= 2 * self._period:
            self.starvation.note(now, self.gap - self._period)
        self.operational = inputs.operational
        self.nmt = inputs.nmt
        self.bus = inputs.bus
        self.emcy = inputs.emcy
        self.replies = {reply.id: reply for reply in inputs.sdo} if inputs.sdo else {}
        # In a late cycle the values are as old as it is late, because no SYNC went out meanwhile: that is not the drive's silence.
        since = now - max(0.0, self.gap - self._period) if self.gap < math.inf else now
        self._take_statusword(inputs.statusword, since - ages[0])
        self.mode = _fresh(inputs.mode, since - ages[1])
        self._take_position(inputs.position, since - ages[2])
        self.velocity = _fresh(inputs.velocity, since - ages[3])
        self.torque = _fresh(inputs.torque, since - ages[4])
        self._take_demand(_fresh(inputs.demand, since - ages[5]))

    def rebase(self) -> None:
        """Count from the drive's own value again: after homing, where the drive's position jumps."""
        if self._raw_position is not None:
            self.position = self._raw_position
        self._anchor = None

    @property
    def reference(self) -> int | None:
        """The position that a controller should hold: the demand (6062h), else the actual position; None if unknown."""
        return self.demand if self.demand is not None else self.position

    def _take_statusword(self, sample: Sample | None, oldest: float) -> None:
        if sample is None or sample.stamp < oldest:
            self.statusword, self.state = None, State.UNKNOWN
            return
        if sample.value != self.statusword:
            self.statusword = sample.value
            self.state = decode(sample.value)
        self.statusword_stamp = sample.stamp

    def _take_position(self, sample: Sample | None, oldest: float) -> None:
        if sample is None or sample.stamp < oldest:
            self.position, self.standstill, self._anchor = None, False, None
            return
        raw = sample.value
        if self._raw_position is None:
            self.position = raw
        elif self.position is None:
            self.position = (
                raw  # whole turns of the wrap may have been missed: count from the drive's own value
            )
        else:
            self.position += (raw - self._raw_position + INT32_HALF) % INT32_SPAN - INT32_HALF
        self._raw_position = raw
        if sample.stamp != self.position_stamp:
            self.position_stamp = sample.stamp
            self._watch_standstill(self.position, sample.stamp)

    def _watch_standstill(self, position: int, stamp: float) -> None:
        """Standing means: within the tolerance of one anchor for the whole window."""
        anchor = self._anchor
        if anchor is None or abs(position - anchor) > self._tolerance:
            self._anchor, self._anchor_stamp, self.standstill = position, stamp, False
        elif stamp - self._anchor_stamp >= self._window:
            self.standstill = True

    def unwrapped(self, raw: int) -> int | None:
        """Return a position of the drive's own count as unwrapped increments; None while the actual position is unknown."""
        if self.position is None or self._raw_position is None:
            return None
        return self.position + (raw - self._raw_position + INT32_HALF) % INT32_SPAN - INT32_HALF

    def _take_demand(self, raw: int | None) -> None:
        self.demand = None if raw is None else self.unwrapped(raw)


def _fresh(sample: Sample | None, oldest: float) -> int | None:
    return None if sample is None or sample.stamp < oldest else sample.value
