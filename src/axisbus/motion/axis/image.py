"""The process image of a drive in one cycle: fresh values or None, the power-stage state, and the standstill of the axis."""

from __future__ import annotations

import math

from axisbus.cia301.emcy import Emcy
from axisbus.cia402.port import Capabilities, Inputs, Sample, SdoReply, ValueTransport
from axisbus.cia402.state import ENERGISED, PowerState, decode
from axisbus.cpu_starvation import Starvation
from axisbus.errors import BusError
from axisbus.motion.axis.loss import Loss, loss_between
from axisbus.motion.axis.reference import PendingOutputs, ReferenceTracker
from axisbus.motion.parameters import DemandUse
from axisbus.motion.stop.settled_value import SettledValue
from axisbus.units import INT32_HALF, INT32_LEAST, unwrap

_HALF = float(INT32_HALF)  # one type for all values compared in every cycle
_ENABLED = PowerState.OPERATION_ENABLED
_RARER = 1.5  # spacings of the position: a demand whose spacing is longer comes less often
_SLOWEST_DEMAND = 0.5  # seconds: a demand that is sent on change arrives within this time if it moves
_SLOWEST = 1.0  # seconds: positions farther apart give no velocity
# Seconds between two positions that are enough for a velocity: the noise of an encoder would be a high one in a shorter time.
_VELOCITY_BASE = 0.008
_TRANSFER = 0.25  # seconds that an SDO may wait for others, and take
# Seconds by which the sampling times of two values from different sources may differ from their stamps.
_DELAY = 0.005
_LATE = 1.5  # of the usual interval of two positions: if none arrives by then, the position has not changed


class AxisImage:
    """The decoded inputs of one axis; holds state: the unwrapped position, and whether it and the demand are constant.

    A value older than its maximum age, or never received, is None: *unknown*. Positions are unwrapped increments: they continue
    past the wrap of INTEGER32, also across a time without a known position. ``origin`` is the position that the user calls 0 (set
    by ``set_position``). ``reference_tracker``: the set-points of the axis (``ReferenceTracker``). ``flight``: the outputs that the
    drive may not have answered yet. ``override``: the factor for the velocities of commands. ``shown_demand`` is 6062h as the drive
    reports it, ``demand`` the same if it is trusted, and ``lead`` its distance ahead of the axis when it was sampled. ``loss``: see
    ``AxisCore.forget``.

    ``restarted``, ``duplicate``: see ``Inputs``. Values received by PDO are unknown after a restart; ``since_restart`` has the
    statusword and position received since (each may be None), which can contradict a stop, but not confirm it.
    """

    __slots__ = (
        "_before",
        "_before_stamp",
        "_checkpoint",
        "_checkpoint_stamp",
        "_demand_spacing",
        "_demands_with_positions",
        "_earlier",
        "_earlier_stamp",
        "_period",
        "_raw_position",
        "bus",
        "demand",
        "demand_repeats",
        "demand_stamp",
        "duplicate",
        "edge_delay",
        "emcy",
        "fastest",
        "flight",
        "gap",
        "guarded",
        "had_demand",
        "lag",
        "last_position",
        "lead",
        "lead_stamp",
        "loss",
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
        "reference_tracker",
        "replies",
        "restarted",
        "shown_demand",
        "since_restart",
        "starvation",
        "state",
        "statusword",
        "statusword_by_event",
        "statusword_by_sdo",
        "statusword_stamp",
        "still",
        "still_demand",
        "torque",
        "velocity",
        "velocity_stamp",
        "velocity_transfer",
    )

    def __init__(
        self,
        capabilities: Capabilities,
        period: float,
        tolerance: float,
        window: float,
        demand: DemandUse = DemandUse.AUTO,
        pull_window: float = math.inf,
        quick: float | None = None,
    ) -> None:
        """``period``: scan period in seconds; ``tolerance``: increments that an axis at standstill may move within ``window`` s.

        ``demand``, ``pull_window``: see ``AxisParameters``. ``quick``: deceleration of a quick stop in increments per s².
        """
        ages = capabilities.max_age
        self.max_age = tuple(
            ages.get(name, math.inf)
            for name in ("statusword", "mode", "position", "velocity", "torque", "demand")
        )
        self._period = period
        self.still = SettledValue(tolerance, window)
        self.still_demand = SettledValue(tolerance, window)
        # In this case silence means that the statusword has not changed.
        self.statusword_by_event = capabilities.inputs.get("statusword") is ValueTransport.EVENT_PDO
        self.statusword_by_sdo = capabilities.inputs.get("statusword") is ValueTransport.SDO
        self.edge_delay = capabilities.edge_delay
        self.guarded = capabilities.guarded
        by_sdo = capabilities.outputs.get("target_velocity") is ValueTransport.SDO
        self.velocity_transfer = (
            _TRANSFER if by_sdo else 0.0
        )  # seconds that the transfer of a target velocity may take
        self._raw_position: int | None = None
        self.last_position = 0  # the last known one, however old (0: there was none), unwrapped
        self.fastest = _HALF  # increments per s: more than 606Ch can represent
        # By the state that the drive shows; until the core has discarded the void values.
        self.loss: Loss | None = None
        self.lost_count = False  # in this cycle: half the drive's count may have passed unseen
        self.now = -math.inf
        self.gap = 0.0  # seconds since the previous cycle
        self.origin = 0
        self.operational = False
        self.overdue = self.restarted = False
        self.duplicate = ""
        self.since_restart: tuple[Sample | None, Sample | None] = (None, None)
        self.lag = 0.0
        self.override = 1.0
        self.nmt = -1
        self.bus: BusError | None = None
        self.statusword: int | None = None
        self.statusword_stamp = -math.inf
        self.state = PowerState.UNKNOWN
        self.mode: int | None = None
        self.mode_stamp = -math.inf
        self.position: int | None = None
        self.position_stamp = -math.inf
        self.velocity: int | None = None
        self.velocity_stamp = -math.inf
        self.torque: int | None = None
        self.shown_demand: int | None = None
        self.demand: int | None = None
        self.lead: float | None = None
        self.reference_tracker = ReferenceTracker(demand, pull_window, quick and quick * period**2, period)
        self.flight = PendingOutputs(period)
        self.demand_stamp = -math.inf
        self.had_demand = False  # one had arrived in the previous cycle
        # Otherwise its silence means that it has not changed.
        self.demand_repeats = math.isfinite(self.max_age[5])
        sources = [capabilities.inputs.get(name) for name in ("position", "demand")]
        # In this case values that arrive in one cycle belong to one SYNC, whatever the order of their frames.
        self._demands_with_positions = sources == [ValueTransport.SYNC_PDO] * 2
        self._demand_spacing = 0.0  # seconds between the last two
        self.lead_stamp = -math.inf  # when the two values compared by ``lead`` were sampled
        self._before = 0  # the position before the last one
        self._before_stamp = -math.inf
        # The base of a velocity: an earlier position, and the one that is the next base once it is old enough.
        self._earlier = self._checkpoint = 0
        self._earlier_stamp = self._checkpoint_stamp = -math.inf
        self.starvation = Starvation()
        self.replies: dict[int, SdoReply] = {}
        self.emcy: tuple[Emcy, ...] = ()

    def update(self, inputs: Inputs) -> None:
        """Evaluate the inputs of this cycle."""
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
            self.restarted,
            self.duplicate,
            self.lag,
        ) = inputs
        if self.restarted:
            self.since_restart = word, position
            word = mode = position = velocity = torque = demand = None
        if sdo or self.replies:
            self.replies = {reply.id: reply for reply in sdo}
        # In a late cycle the values are older by its delay, because no SYNC was sent meanwhile: this is not the drive's silence.
        self.gap = gap = now - self.now
        self.now = now
        since, late, ages = now, gap - self._period, self.max_age
        if late > 0.0:
            since -= late if late < self._period else self._late(late)
        if word is None or word.stamp < since - ages[0]:
            self.statusword, self.state = None, PowerState.UNKNOWN
        else:
            if word.value != self.statusword:
                self.statusword = word.value
                state = decode(word.value)
                if state is not self.state:
                    self._enter(state)
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
        ):  # without a demand there is nothing to evaluate, except once after its loss
            self.had_demand = demand is not None
            self.take_demand(demand, since - ages[5])

    def update_unchanged(self, now: float, word: Sample, mode: Sample, position: Sample) -> None:
        """Evaluate the cycle at ``now`` as ``update`` does, if state and mode are unchanged and the position has not wrapped."""
        self.gap = now - self.now
        self.now = now
        self.statusword, self.statusword_stamp = word
        self.mode_stamp = mode.stamp
        raw, stamp = position
        if stamp != self.position_stamp:
            self._renew_position(raw, stamp)
        self._raw_position = self.position = self.last_position = raw

    def _renew_position(self, position: int, stamp: float) -> None:
        """Take a newer position, before it becomes the last one."""
        self._before, self._before_stamp = self.last_position, self.position_stamp
        self.position_stamp = stamp
        self.still.feed(position, stamp)
        if stamp - self._checkpoint_stamp >= _VELOCITY_BASE:
            self._earlier, self._earlier_stamp = self._checkpoint, self._checkpoint_stamp
            self._checkpoint, self._checkpoint_stamp = position, stamp

    def rebase(self) -> None:
        """Count from the drive's own value again: after homing, when the drive's position jumps."""
        if self._raw_position is not None:
            self.position = self.last_position = self._raw_position
        self.recount()

    def recount(self) -> None:
        """Discard the values that refer to the old origin."""
        self.still.forget()
        self.still_demand.forget()
        self.shown_demand = self.demand = self.lead = None
        self._before_stamp = self._earlier_stamp = self._checkpoint_stamp = -math.inf
        self.reference_tracker.recount(self.now)

    def restart(self) -> None:
        """Begin again with the drive's next own value: its count has another origin now."""
        self._raw_position = None
        self._earlier_stamp = self._checkpoint_stamp = -math.inf

    @property
    def standstill(self) -> bool:
        """Whether the position has not moved over the window, by its fresh values; ``StandstillCheck`` requires more for a stop."""
        return self.still.still

    def speed(self, per_velocity: float) -> float | None:
        """Return the velocity in increments/s: 606Ch, or that of the last positions if they are newer; None if unknown.

        ``per_velocity``: increments/s of one velocity increment of the drive.
        """
        if self.velocity is None:
            return None
        if self.velocity_stamp < self._before_stamp < self.position_stamp and self.position is not None:
            if self.still.still:
                return 0.0
            before, stamp = self._before, self._before_stamp
            if self._earlier_stamp > -math.inf:
                before, stamp = self._earlier, self._earlier_stamp
            return (self.position - before) / (self.position_stamp - stamp)
        return self.velocity * per_velocity

    @property
    def demand_lead(self) -> float | None:
        """The distance of the demand ahead of the axis when it was sampled; None if no demand counts.

        A sample from before the present mode, power or count does not count, unless silence means that the value is still valid.
        """
        if not self.reference_tracker.counts(self.demand, self.mode):
            return None
        return None if self.awaits_demand else self.lead

    @property
    def demand_is_rarer(self) -> bool:
        """Whether the demand comes less often than the position, by the last two samples of each."""
        return self._demand_spacing > _RARER * (self.position_stamp - self._before_stamp)

    @property
    def awaits_demand(self) -> bool:
        """Whether the next demand must arrive before the demand can be evaluated."""
        return self.demand_repeats and self.demand_stamp <= self.reference_tracker.since

    @property
    def pull(self) -> float | None:
        """Commanded minus actual position, in increments; None if unknown or if nothing moves the axis (``ReferenceTracker``)."""
        return self.reference_tracker.pull(
            self.demand_lead, self.position, self.state, self.still.rested_since
        )

    @property
    def reference(self) -> int | None:
        """The position that a controller should hold: the demand (6062h), else the actual position; None if unknown."""
        return self.demand if self.demand is not None else self.position

    def _late(self, late: float) -> float:
        """Record that cycles were missed; return by how many seconds this one is late (0 for the first cycle)."""
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
        if stamp != self.position_stamp:
            self._renew_position(position, stamp)
        self.position = self.last_position = position

    def _enter(self, state: PowerState) -> None:
        """Enter the state that the drive shows. A demand from before a change of power is not valid any more."""
        if (state in ENERGISED) is not (self.state in ENERGISED):
            self.reference_tracker.begin(self.now)
            self.reference_tracker.idle = self.reference_tracker.idle or state not in ENERGISED
        self.loss = loss_between(self.state, state) or self.loss
        self.state = state

    def take_demand(self, sample: Sample | None, oldest: float) -> None:
        """Evaluate 6062h; a sample older than ``oldest`` is unknown."""
        position = self.position
        if sample is None or position is None or sample.stamp < oldest:
            if sample is not None:
                self.demand_stamp = sample.stamp
            self.shown_demand = self.demand = self.lead = None
            return
        raw, stamp = sample
        trust = self.reference_tracker.trust
        # A demand from before the new count does not belong to it, unless silence means that it is still valid.
        if stamp != self.demand_stamp or (self.shown_demand is None and not self.demand_repeats):
            if not -INT32_HALF <= raw - position < INT32_HALF:
                raw = unwrap(position, raw)
            self._demand_spacing = min(stamp - self.demand_stamp, _SLOWEST_DEMAND)
            self.demand_stamp = self.lead_stamp = stamp
            self.shown_demand = raw
            self.still_demand.feed(raw, stamp)
            if self._demands_with_positions and -self._period < stamp - self.position_stamp < self._period:
                self.lead, doubt = raw - position, 0.0
            else:
                self.lead, doubt = self._lead_at(raw, stamp)
            if not trust.everywhere and self.state is _ENABLED:
                trust.look(raw, self.lead, doubt, self.mode)
        elif not self.demand_repeats and self.now - stamp > _LATE * self._demand_spacing:
            # The silence is too long for an inhibit time: the demand has not changed.
            assert self.shown_demand is not None
            self.lead, self.lead_stamp = self.shown_demand - position, self.position_stamp
        self.demand = self.shown_demand if trust.trusts(self.mode) else None

    def _lead_at(self, demand: int, stamp: float) -> tuple[float, float]:
        """Return how far a demand received at ``stamp`` was ahead of the axis, and the possible error of this distance.

        Between two positions the axis is assumed to move evenly. After the last position, the axis was between that position and
        the one that it has reached since if it continued at its speed. A demand within this range has no lead.
        """
        position = self.last_position
        passed, spacing = stamp - self.position_stamp, self.position_stamp - self._before_stamp
        if not 0.0 < spacing < _SLOWEST or passed > _LATE * spacing:
            return demand - position, 0.0
        speed = (position - self._before) / spacing
        lead, beyond = demand - position, demand - position - speed * passed
        doubt = abs(speed) * max(_DELAY, abs(passed))
        if passed <= 0.0:
            return beyond, doubt
        if lead * beyond <= 0.0:
            return 0.0, doubt
        return min(lead, beyond, key=abs), doubt

    def unwrapped(self, raw: int) -> int | None:
        """Return a position of the drive's own count as unwrapped increments; None while the actual position is unknown."""
        if self.position is None or self._raw_position is None:
            return None
        return unwrap(self.position, raw)
