"""What is known of a drive in one cycle: fresh values or None, the power-stage state, and whether the axis stands."""

from __future__ import annotations

import math

from axisbus.cia301.emcy import Emcy
from axisbus.cia402.port import Capabilities, Inputs, Sample, SdoReply, Source
from axisbus.cia402.starvation import Starvation
from axisbus.cia402.state import State, decode
from axisbus.errors import BusError
from axisbus.motion.axis.flight import Flight
from axisbus.motion.axis.led import Led
from axisbus.motion.stop.still import Still
from axisbus.units import INT32_HALF, INT32_LEAST, unwrap

_HALF = float(INT32_HALF)  # what is compared in every cycle is of one type


class Image:
    """The decoded inputs of one axis; holds state: the unwrapped position, and whether it and the demand are still.

    A value older than its maximum age, or never received, is None: *unknown*. Positions are unwrapped increments: they go on past
    the wrap of INTEGER32, also over a time in which none was known. ``origin`` is the position that the user calls 0 (set by
    ``set_position``). ``led``: what leads the axis. ``flight``: what it was sent and may not have answered. ``override``: by what
    the velocities of commands are to be multiplied.
    """

    __slots__ = (
        "_period",
        "_raw_position",
        "bus",
        "demand",
        "demand_repeats",
        "demand_stamp",
        "edge_delay",
        "emcy",
        "fastest",
        "flight",
        "gap",
        "guarded",
        "had_demand",
        "lag",
        "last_position",
        "led",
        "lost_count",
        "max_age",
        "mode",
        "mode_stamp",
        "nmt",
        "now",
        "operational",
        "origin",
        "overdue",
        "override",
        "position",
        "position_stamp",
        "replies",
        "starvation",
        "state",
        "statusword",
        "statusword_by_event",
        "statusword_stamp",
        "still",
        "still_demand",
        "torque",
        "velocity",
        "velocity_stamp",
    )

    def __init__(self, capabilities: Capabilities, period: float, tolerance: float, window: float) -> None:
        """``period``: of the scan, in seconds; ``tolerance``: increments that a standing axis may wander within ``window`` s."""
        ages = capabilities.max_age
        self.max_age = tuple(
            ages.get(name, math.inf)
            for name in ("statusword", "mode", "position", "velocity", "torque", "demand")
        )
        self._period = period
        self.still = Still(tolerance, window)
        self.still_demand = Still(tolerance, window)
        # Then silence means that it has not changed.
        self.statusword_by_event = capabilities.inputs.get("statusword") is Source.EVENT_PDO
        self.edge_delay = capabilities.edge_delay
        self.guarded = capabilities.guarded
        self._raw_position: int | None = None
        self.last_position = 0  # the last one that was known, however old (0: there was none), unwrapped
        self.fastest = _HALF  # increments per s: more than 606Ch can say
        self.lost_count = False  # in this cycle: half the drive's count may have passed unseen
        self.now = -math.inf
        self.gap = 0.0  # seconds since the cycle before
        self.origin = 0
        self.operational = False
        self.overdue = False
        self.lag = 0.0
        self.override = 1.0
        self.nmt = -1
        self.bus: BusError | None = None
        self.statusword: int | None = None
        self.statusword_stamp = -math.inf
        self.state = State.UNKNOWN
        self.mode: int | None = None
        self.mode_stamp = -math.inf
        self.position: int | None = None
        self.position_stamp = -math.inf
        self.velocity: int | None = None
        self.velocity_stamp = -math.inf
        self.torque: int | None = None
        self.demand: int | None = None
        self.led = Led()
        self.flight = Flight(period)
        self.demand_stamp = -math.inf
        self.had_demand = False  # in the cycle before one had come
        self.demand_repeats = math.isfinite(self.max_age[5])  # else its silence says that it has not changed
        self.starvation = Starvation()
        self.replies: dict[int, SdoReply] = {}
        self.emcy: tuple[Emcy, ...] = ()

    def update(self, inputs: Inputs) -> None:
        """Take the inputs of this cycle."""
        (
            now,
            self.operational,
            word,
            mode,
            position,
            velocity,
            torque,
            demand,
            self.emcy,
            sdo,
            self.nmt,
            self.bus,
            self.overdue,
            self.lag,
        ) = inputs
        if sdo or self.replies:
            self.replies = {reply.id: reply for reply in sdo}
        # In a late cycle the values are as old as it is late, because no SYNC went out meanwhile: that is not the drive's silence.
        self.gap = gap = now - self.now
        self.now = now
        since, late, ages = now, gap - self._period, self.max_age
        if late > 0.0:
            since -= late if late < self._period else self._late(late)
        if word is None or word.stamp < since - ages[0]:
            self.statusword, self.state = None, State.UNKNOWN
        else:
            if word.value != self.statusword:
                self.statusword = word.value
                self.state = decode(word.value)
            self.statusword_stamp = word.stamp
        self.mode = None if mode is None or mode.stamp < since - ages[1] else mode.value
        if mode is not None:
            self.mode_stamp = mode.stamp
        self._take_position(position, since - ages[2])
        if velocity is None:
            self.velocity = None
        else:
            self.velocity = None if velocity.stamp < since - ages[3] else velocity.value
            self.velocity_stamp = velocity.stamp
        self.torque = None if torque is None or torque.stamp < since - ages[4] else torque.value
        if (
            demand is not None or self.had_demand
        ):  # where there is none, there is nothing to be judged but that once
            self.had_demand = demand is not None
            self.take_demand(demand, since - ages[5])

    def go_on(self, now: float, word: Sample, mode: Sample, position: Sample) -> None:
        """Take the cycle at ``now`` as ``update`` does, where state and mode are as they were and the position has not wrapped."""
        self.gap = now - self.now
        self.now = now
        self.statusword, self.statusword_stamp = word
        self.mode_stamp = mode.stamp
        raw, stamp = position
        self._raw_position = self.position = self.last_position = raw
        if stamp != self.position_stamp:
            self.position_stamp = stamp
            self.still.feed(raw, stamp)

    def rebase(self) -> None:
        """Count from the drive's own value again: after homing, where the drive's position jumps."""
        if self._raw_position is not None:
            self.position = self.last_position = self._raw_position
        self.still.forget()
        self.still_demand.forget()
        self.demand = None  # it counted from the old one
        self.led.forget()

    def restart(self) -> None:
        """Count from the drive's own value with the next one: it counts anew."""
        self._raw_position = None

    @property
    def standstill(self) -> bool:
        """Whether the position has not moved over the window, by what is fresh; ``Standing`` asks more of a stop."""
        return self.still.still

    @property
    def pull(self) -> int | None:
        """How far the axis is led from where it is, in increments; None where nobody knows, or nothing leads it (see ``Led``)."""
        return self.led.pull(self.demand, self.position, self.state, self.mode)

    @property
    def reference(self) -> int | None:
        """The position that a controller should hold: the demand (6062h), else the actual position; None if unknown."""
        return self.demand if self.demand is not None else self.position

    def _late(self, late: float) -> float:
        """Note that cycles were missed; return by how many seconds this one is late: the first one is not."""
        self.starvation.note(self.now, late)
        return late if late < math.inf else 0.0

    def _take_position(self, sample: Sample | None, oldest: float) -> None:
        self.lost_count = False
        if sample is None or sample.stamp < oldest:
            self.position = None
            self.still.forget()
            return
        raw, stamp = sample
        position = raw
        if self._raw_position is not None:
            self.lost_count = (stamp - self.position_stamp) * self.fastest >= _HALF
            if not INT32_LEAST <= raw - self.last_position < INT32_HALF:
                position = unwrap(self.last_position, raw)
        self._raw_position = raw
        self.position = self.last_position = position
        if stamp != self.position_stamp:
            self.position_stamp = stamp
            self.still.feed(position, stamp)

    def take_demand(self, sample: Sample | None, oldest: float) -> None:
        """Take 6062h; what is older than ``oldest`` is unknown."""
        demand, position, led = None, self.position, self.led
        if sample is not None:
            self.demand_stamp = sample.stamp
            if sample.stamp >= oldest and position is not None and not led.idle:
                demand = unwrap(position, sample.value)
                self.still_demand.feed(demand, sample.stamp)
        if not led.idle and led.judge(demand, position, self.state, self.mode):
            demand = None
        self.demand = demand

    def unwrapped(self, raw: int) -> int | None:
        """Return a position of the drive's own count as unwrapped increments; None while the actual position is unknown."""
        if self.position is None or self._raw_position is None:
            return None
        return unwrap(self.position, raw)
