"""The commands of an axis, as frozen values in increments that can be pickled."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from axisbus.cia402.touch_probe import Edge, ProbeSource
from axisbus.motion.blending.mode import BufferMode
from axisbus.motion.moves.homing import HomingJob
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.stop.policy import GroupFault
from axisbus.motion.trajectory import Trajectory


class TargetReference(Enum):
    """The position to which the value of a move refers."""

    ABSOLUTE = "absolute"
    RELATIVE = "relative"  # to the actual position when the move starts
    ADDITIVE = "additive"  # to the last commanded position


@dataclass(frozen=True, slots=True)
class EnableCommand:
    """MC_Power, on; ``moving``: catch a moving axis instead of waiting until it is at standstill."""

    moving: bool = False


@dataclass(frozen=True, slots=True)
class Disable:
    """MC_Power, off; ``coast`` cuts the power at once (transition 9)."""

    coast: bool = False


@dataclass(frozen=True, slots=True)
class ResetCommand:
    """MC_Reset."""


@dataclass(frozen=True, slots=True)
class Halt:
    """MC_Halt."""


@dataclass(frozen=True, slots=True)
class Stop:
    """MC_Stop: locks the axis until ``Release``."""


@dataclass(frozen=True, slots=True)
class Release:
    """The end of MC_Stop's lock."""


@dataclass(frozen=True, slots=True)
class QuickStop:
    """Quick stop of the drive (605Ah)."""


@dataclass(frozen=True, slots=True)
class Move:
    """MC_MoveAbsolute, MC_MoveRelative, MC_MoveAdditive: ``value`` in increments, from the reference."""

    reference: TargetReference
    value: int
    profile: MoveProfile


@dataclass(frozen=True, slots=True)
class MoveVelocity:
    """MC_MoveVelocity; the velocity of ``profile`` is signed. ``life`` in seconds: MC_Jog, which ends unless it is renewed.

    ``continue_only``: extend the active jog. If the jog has ended, for example by a halt of any client, no new one begins.
    """

    profile: MoveProfile
    life: float | None = None
    continue_only: bool = False


@dataclass(frozen=True, slots=True)
class TorqueControl:
    """MC_TorqueControl: ``torque`` in 0.1 % of rated torque, ``slope`` in 0.1 %/s (None: the drive's own slope)."""

    torque: int
    slope: int | None
    timeout: float | None = None


@dataclass(frozen=True, slots=True)
class CyclicVelocity:
    """A velocity (60FFh, signed) in csv; its ramps in velocity increments per s², above 0."""

    velocity: int
    acceleration: float
    deceleration: float


@dataclass(frozen=True, slots=True)
class CyclicTorque:
    """A torque (6071h, 0.1 % of rated torque, signed) in cst; ``slope`` in 0.1 % per s, above 0, ``timeout`` in seconds."""

    torque: int
    slope: int
    timeout: float | None = None


@dataclass(frozen=True, slots=True)
class ControllerCommand:
    """A controller in the user's program: each cycle it answers with a ``ControllerOutput``, a velocity in csv or a torque in cst.

    ``by`` has the ramps towards the output. ``number`` identifies this controller. An output may be computed from values that are
    ``max_missed_cycles`` cycles (0 or more) older than those of the previous cycle.
    """

    number: int
    by: CyclicVelocity | CyclicTorque
    max_missed_cycles: int = 0


@dataclass(frozen=True, slots=True)
class ControllerOutput:
    """The output of the controller ``number`` for the values of the cycle at ``cycle`` (s, monotonic).

    ``value`` as in ``CyclicVelocity`` or ``CyclicTorque``; a non-empty ``failure`` is the reason why the controller has ended.
    """

    number: int
    cycle: float
    value: int
    failure: str = ""


@dataclass(frozen=True, slots=True)
class Home:
    """MC_Home."""

    job: HomingJob


@dataclass(frozen=True, slots=True)
class SetPosition:
    """MC_SetPosition: define the actual position as ``position`` (increments)."""

    position: int


@dataclass(frozen=True, slots=True)
class FollowTrajectory:
    """A trajectory in cyclic synchronous position mode."""

    trajectory: Trajectory


@dataclass(frozen=True, slots=True)
class Buffered:
    """``command`` begins when the previous command has ended as done (PLCopen's buffer mode *Buffered*)."""

    command: Move | MoveVelocity


@dataclass(frozen=True, slots=True)
class BufferedMove:
    """``move`` takes over from the previous command without a stop, at the velocity defined by ``mode`` (PLCopen's BufferMode).

    ``direction``: of a move to a position of a modulo axis, from the end of the previous move: 0 shortest, 1 positive, -1 negative.
    """

    move: Move
    mode: BufferMode
    direction: int = 0


@dataclass(frozen=True, slots=True)
class GearOut:
    """MC_GearOut, MC_CamOut: a slave leaves its master and continues at its present velocity."""


@dataclass(frozen=True, slots=True)
class Probe:
    """MC_TouchProbe: report the axis position at the next edge of each kind of input ``number`` (1 or 2), or at every edge.

    ``window``: the position range (in units) within which an edge counts. ``key`` distinguishes this request from others of its
    program.
    """

    number: int
    edges: frozenset[Edge]
    source: ProbeSource
    continuous: bool
    window: tuple[float, float] | None
    key: int


@dataclass(frozen=True, slots=True)
class ProbeAbort:
    """MC_AbortTrigger: switch input ``number`` off; with ``key``, only if that request has armed it."""

    number: int
    key: int | None = None


@dataclass(frozen=True, slots=True)
class SetOverride:
    """MC_SetOverride: motion planned by the master or the drive runs at ``factor`` times its velocity, from 0 (hold) to 1.5."""

    factor: float


@dataclass(frozen=True, slots=True)
class SetTorqueOffset:
    """The constant torque of feed-forward (60B2h), in 0.1 % of rated torque."""

    torque: int


@dataclass(frozen=True, slots=True)
class PhaseBy:
    """MC_PhasingRelative: shift the master, as the slave sees it, by ``shift`` units, at ``velocity`` and ``acceleration`` or less.

    All in units of the master, per s and per s²; both above 0.
    """

    shift: float
    velocity: float
    acceleration: float


@dataclass(frozen=True, slots=True)
class MoveSuperimposed:
    """MC_MoveSuperimposed: add ``distance`` to the axis's motion; in its unit, per s and per s²; all but ``distance`` above 0."""

    distance: float
    velocity: float
    acceleration: float
    deceleration: float


@dataclass(frozen=True, slots=True)
class HaltSuperimposed:
    """MC_HaltSuperimposed: stop the superimposed motion, by ``deceleration`` (unit/s²; None: its own); the path continues."""

    deceleration: float | None = None


@dataclass(frozen=True, slots=True)
class Shutdown:
    """The stop sequence down to a disabled drive, at the end of the program; ``quick``: begin with quick stop."""

    reason: str
    quick: bool = False


@dataclass(frozen=True, slots=True)
class PolicyStop:
    """A halt that the fault policy orders because of another axis; ``how``: how the axis stops."""

    reason: str
    how: GroupFault = GroupFault.PATH


@dataclass(frozen=True, slots=True)
class HandOver:
    """A halt because control of the machine passes to another program, or because its holder is gone or interrupted."""

    reason: str


Command = (
    EnableCommand
    | Disable
    | ResetCommand
    | Halt
    | Stop
    | Release
    | QuickStop
    | Move
    | MoveVelocity
    | TorqueControl
    | CyclicVelocity
    | CyclicTorque
    | ControllerCommand
    | ControllerOutput
    | Home
    | SetPosition
    | FollowTrajectory
    | Buffered
    | BufferedMove
    | GearOut
    | Probe
    | ProbeAbort
    | SetOverride
    | SetTorqueOffset
    | PhaseBy
    | MoveSuperimposed
    | HaltSuperimposed
    | Shutdown
    | PolicyStop
    | HandOver
)
