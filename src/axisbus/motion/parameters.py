"""Parameters of one axis for the motion code, as frozen values in increments and seconds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from axisbus.cia402 import objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.stop_deceleration import BRAKES, Braking
from axisbus.units import Scale


@dataclass(frozen=True, slots=True)
class FeedForward:
    """Settings of ``[axes.NAME.feed_forward]``.

    ``velocity``: send 60B1h in csp. ``inertia`` in N·m per unit/s² and ``torque`` (constant) in N·m: send 60B2h in csp and csv.
    ``turned``: the drive inverts velocities (607Eh bit 6) but not positions (bit 7), or vice versa, so that the velocity of a
    position has the opposite sign.
    """

    velocity: bool = False
    inertia: float | None = None
    torque: float | None = None
    turned: bool = False

    @property
    def by_torque(self) -> bool:
        """Whether 60B2h is sent at all."""
        return self.inertia is not None or self.torque is not None

    @property
    def outputs(self) -> tuple[str, ...]:
        """The names of the offsets that are sent (``cia402.port.OFFSET_OBJECTS``)."""
        return ("velocity_offset",) * self.velocity + ("torque_offset",) * self.by_torque

    @property
    def objects(self) -> frozenset[int]:
        """The objects that are sent."""
        found = [objects.VELOCITY_OFFSET] * self.velocity + [objects.TORQUE_OFFSET] * self.by_torque
        return frozenset(found)


class HoldsLoad(Enum):
    """The holding of a vertical axis's load: nothing (not needed), the drive's brake, or only the motor's torque."""

    NO = "no"
    BRAKE = "brake"
    TORQUE = "torque"


class DemandUse(Enum):
    """Whether 6062h (position demand value) counts as the commanded position: judged by its behaviour, always, or never."""

    AUTO = "auto"
    USE = "use"
    IGNORE = "ignore"


class Handshake(Enum):
    """How the master detects that a drive has accepted a set-point: by bit 12 of 6041h, or by the axis's motion."""

    ACKNOWLEDGE = "acknowledge"
    ON_CHANGE = "on-change"


@dataclass(frozen=True, slots=True)
class Units:
    """Conversion between the axis's unit and increments.

    ``velocity`` and ``acceleration`` convert unit/s and unit/s² into the drive's own velocity and acceleration increments; they are
    None if only raw values can be given. ``ratio_known``: velocity increments can be compared with position increments (deadlines
    and braking distances need that). ``rated_torque`` is in N·m, None if torque has no unit.
    """

    position: Scale
    velocity: Scale
    acceleration: Scale
    ratio_known: bool
    rated_torque: float | None = None
    modulo: float | None = None

    @property
    def per_velocity(self) -> float:
        """Position increments per s in one velocity increment; valid only if ``ratio_known``."""
        return self.position.factor / self.velocity.factor

    def turned(self, position: float) -> float:
        """Return a position in units as the user sees it: for a modulo axis, within its modulo."""
        return position if self.modulo is None else position % self.modulo

    def torque(self, raw: int) -> float:
        """Return a torque of the drive (0.1 % of rated torque) in N·m, or as a fraction of the rated torque if that is unknown.

        If the master reverses the direction of the axis, the sign of the torque is reversed too: ``rated_torque`` is then negative,
        like the position's factor.
        """
        rated = self.rated_torque
        if rated is None:
            rated = -1.0 if self.position.factor < 0 else 1.0
        return raw / 1000.0 * rated


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """Limits that the master enforces, in units (unit, unit/s, unit/s²) and N·m; None: no limit.

    ``torque_key``: the setting that the torque limit comes from.
    """

    position: tuple[float, float] | None = None
    velocity: float | None = None
    acceleration: float | None = None
    torque: float | None = None
    torque_key: str = field(default="max_torque", repr=False)


@dataclass(frozen=True, slots=True)
class Defaults:
    """Values for commands that leave them out, in units; None if cell.toml gives none."""

    velocity: float | None = None
    acceleration: float | None = None
    deceleration: float | None = None
    torque_slope: float | None = None
    jerk: float | None = None


@dataclass(frozen=True, slots=True)
class HomingParameters:
    """How the axis is homed: method of 6098h, speeds in unit/s, acceleration in unit/s², ``timeout`` in seconds."""

    method: int | None = None
    speed_switch: float | None = None
    speed_zero: float | None = None
    acceleration: float | None = None
    timeout: float | None = None
    required: bool = False


@dataclass(frozen=True, slots=True)
class StopTimes:
    """Deadline of each step of the stop sequence in seconds: halt, quick stop, power off."""

    halt: float = 2.0
    quick_stop: float = 1.0
    disable: float = 3.0  # three transitions, including the brake's time

    @property
    def stop_sequence(self) -> float:
        """Longest duration of all steps in seconds, including power off at the end."""
        return self.halt + self.quick_stop + 2 * self.disable


@dataclass(frozen=True, slots=True)
class DriveTimeouts:
    """Timeouts of the communication with the drive, in seconds of the monotonic clock."""

    transition: float = 2.0  # one step of the power stage; brakes take up to a second
    mode: float = 1.0  # 6061h follows 6060h
    acknowledge: float = 1.0  # set-point acknowledge, both edges
    sdo: float = 3.0  # all transfers of one command
    progress: float = 2.0  # 6064h unchanged: the motion makes no progress
    settle: float = 0.1  # bits of a previous homing may still be set
    standstill_time: float = 0.05  # length of the interval in which positions are compared
    jog: float = 0.2
    # To read 603Fh and the vendor's bits after a fault; a lost SDO request is repeated after 0.5 s.
    diagnosis: float = 0.7


_PROFILE_DECELERATION = 0x6084
NOISE = 4.0  # increments between two positions of a motor at rest: an encoder varies by ±2
_UNSEEN_SHARE = 0.05  # of the highest speed: slower motion may count as standstill
_LONGEST_STANDSTILL_TIME = 0.3  # seconds
_LEAST_PULL = 20.0  # increments
_PULL_TIME = 0.01  # seconds at max_velocity
_LAG_TIME = 0.25  # seconds at the highest speed that was commanded

Explain = Callable[[int, Mapping[tuple[int, int], int]], list[str]]


def no_explanation(_code: int, _details: Mapping[tuple[int, int], int]) -> list[str]:
    """Return no explanation: for a drive of an unknown vendor."""
    return []


def standstill_time(speed: float) -> float:
    """Return the value of ``DriveTimeouts.standstill_time``; ``speed``: the highest speed of the axis in increments per s.

    Positions may vary by ±2 increments at rest, and only more than that is seen as a motion. So a short interval hides a high
    speed of an axis with few increments (a motor with Hall sensors). The interval is long enough for a twentieth of the highest
    speed to be seen, up to 0.3 s.
    """
    shortest = DriveTimeouts().standstill_time
    if not speed:
        return shortest
    return min(max(shortest, (0.5 * NOISE + 1.0) / (_UNSEEN_SHARE * speed)), _LONGEST_STANDSTILL_TIME)


def pull_window(standstill_window: float | None, position_window: float | None, speed: float) -> float:
    """Return the value of ``AxisParameters.pull_window``; all in increments, ``speed``: the highest speed of the axis, per s."""
    if standstill_window is not None:
        return float(standstill_window)
    if position_window is not None:
        return max(_LEAST_PULL, 10.0 * position_window)
    return max(_LEAST_PULL, _PULL_TIME * speed)


@dataclass(frozen=True, slots=True)
class AxisParameters:
    """All parameters of one axis's core; made by ``machine`` from cell.toml, the EDS and the drive's own answers.

    ``objects``: the indices in the drive's dictionary (first-axis numbers). ``read_only``: their entries (index, sub-index) that
    the EDS declares as not writable; commands compare these instead of writing. ``quick_stop_holds``: the drive stays enabled after
    a quick stop (605Ah 5 to 8). ``position_window`` is in increments, None for the derived value; the same applies to
    ``standstill_window`` and ``following_error`` (see ``pull_window`` and ``lag_allowed``). ``explain_fault`` converts 603Fh and
    ``fault_objects`` into sentences (from the drive plug-in's table). ``virtual``: the axis has no drive, and only the core moves
    it; ``encoder``: the name of the input that gives the position of an encoder axis, empty for any other axis.
    """

    name: str
    units: Units
    limits: AxisLimits = field(default_factory=AxisLimits)
    defaults: Defaults = field(default_factory=Defaults)
    homing: HomingParameters = field(default_factory=HomingParameters)
    stop_times: StopTimes = field(default_factory=StopTimes)
    timing: DriveTimeouts = field(default_factory=DriveTimeouts)
    holds_load: HoldsLoad = HoldsLoad.NO
    handshake: Handshake = Handshake.ACKNOWLEDGE
    homing_reached: bool = True  # bit 10 rises at the end of homing; False: standstill replaces it
    objects: frozenset[int] = frozenset()
    read_only: frozenset[tuple[int, int]] = frozenset()
    modes: frozenset[ModeOfOperation] = frozenset()
    quick_stop_holds: bool = False
    braking: Braking = field(default_factory=Braking)
    position_window: int | None = None
    standstill_window: int | None = None  # position increments
    following_error: int | None = None  # position increments
    demand: DemandUse = DemandUse.AUTO
    compares_demand: bool = True  # in motion; False: ``following_error = "off"``
    # position increments: the drive's own 6065h, for the position modes
    drive_following_error: int | None = None
    drive_following_time: float = 0.0  # seconds: the drive's own 6066h
    standstill_speed: float | None = None  # position increments per second
    torque_slope: int | None = None  # the drive's own 6087h, read at boot; None: the drive has none
    # 6083h and 6084h if they are not writable, with the drive's values (None: unknown)
    fixed_ramps: tuple[tuple[int, int | None], ...] = ()
    fault_objects: tuple[tuple[int, int], ...] = ()
    explain_fault: Explain = no_explanation
    node: int = 0
    eds: str = ""  # the file that lists the drive's objects
    virtual: bool = False
    encoder: str = ""
    scan_period: float = 0.01
    feed_forward: FeedForward | None = None
    interpolated: bool = False  # the drive uses ip for what this API calls csp
    limits_in_drive: bool = False  # 607Dh has the position limits as well, from the drive's own zero

    @property
    def standstill_tolerance(self) -> float:
        """Increments by which an axis at standstill may go within ``standstill_time``."""
        return max(0.5 * NOISE, (self.standstill_speed or 0.0) * self.timing.standstill_time)

    @property
    def unseen_speed(self) -> float:
        """Speed in increments per s up to which a motion may look like a standstill: twice the speed that counts as one."""
        return 2.0 * self.standstill_tolerance / self.timing.standstill_time

    @property
    def pull_window(self) -> float:
        """Permitted difference of demand and actual position, in increments, at which an axis at standstill counts as free of pull.

        This is ``standstill_window``. If cell.toml does not set it: ten position windows, otherwise 10 ms at ``max_velocity`` (at
        the default velocity if that is missing), and never less than the noise of a quiet encoder.
        """
        speed = (self.limits.velocity or self.defaults.velocity or 0.0) * abs(self.units.position.factor)
        return pull_window(self.standstill_window, self.position_window, speed)

    @property
    def position_tolerance(self) -> int:
        """Tolerance in increments within which an axis counts as being at a position; by default a tenth of ``pull_window``."""
        return round(self.pull_window / 10) if self.position_window is None else self.position_window

    @property
    def has_lag_window(self) -> bool:
        """Whether an axis commanded by positions has a fixed following error window instead of one that depends on its speed."""
        return self.following_error is not None or self.drive_following_error is not None

    def lag_allowed(self, speed: float, *, by_position: bool = True) -> float:
        """Return the permitted following error in increments; ``speed`` (increments per s): the highest of the last 0.5 s.

        ``by_position``: the axis is commanded by positions, to which the drive's own following error window applies.
        """
        own = self.following_error
        if own is None and by_position:
            own = self.drive_following_error
        return self.pull_window + (_LAG_TIME * speed if own is None else float(own))

    @property
    def position_edges(self) -> tuple[float, float] | None:
        """The position limits in increments from the origin, the lower one first; None: no limits."""
        if self.limits.position is None:
            return None
        low, high = sorted(edge * self.units.position.factor for edge in self.limits.position)
        return low, high

    @property
    def path_deceleration(self) -> float | None:
        """The deceleration of trajectories in unit/s²; None if cell.toml gives no value for it."""
        return self.defaults.deceleration or self.defaults.acceleration or self.limits.acceleration

    @property
    def hardest_deceleration(self) -> float | None:
        """The highest deceleration of a stop in unit/s²: the limit, else the higher one of path and quick stop; None: unknown."""
        limit, quick = self.limits.acceleration, self.braking.quick
        if limit is not None or self.path_deceleration is None:
            return limit
        return max(self.path_deceleration, (quick or 0.0) / abs(self.units.position.factor))

    @property
    def slow_ramp(self) -> float | None:
        """Deceleration in position increments per s²: the fixed value of 6084h, else the value written if a move gives none."""
        fixed = dict(self.fixed_ramps)
        if _PROFILE_DECELERATION in fixed:
            return self.acceleration_increments(fixed[_PROFILE_DECELERATION])
        deceleration = self.path_deceleration
        if deceleration is None or not self.units.ratio_known:
            return None
        return abs(deceleration * self.units.position.factor)

    def acceleration_increments(self, raw: int | None) -> float | None:
        """Return an acceleration of the drive in position increments per s²; None if it is 0 or None, or if its unit is unknown."""
        if not raw or not self.units.ratio_known:
            return None
        return abs(self.units.acceleration.to_units(raw) * self.units.position.factor)

    @property
    def halts_torque_by_mode(self) -> bool:
        """Whether an axis under torque brakes in another mode, because its quick stop would not brake, or would drop a load."""
        if self.holds_load is not HoldsLoad.NO:
            return True
        limited = self.limits.position is not None or self.limits.velocity is not None
        can = ModeOfOperation.PROFILE_VELOCITY in self.modes
        return limited and can and self.braking.quick_stop not in BRAKES

    def has(self, index: int) -> bool:
        """Whether the drive's dictionary has the object."""
        return index in self.objects
