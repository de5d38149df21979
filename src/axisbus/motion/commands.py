"""What a user can ask of an axis, as frozen values in increments that can be pickled."""

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
    """What the number of a move counts from."""

    ABSOLUTE = "absolute"
    RELATIVE = "relative"  # to the actual position when the move starts
    ADDITIVE = "additive"  # to the last commanded position


@dataclass(frozen=True, slots=True)
class EnableCommand:
    """MC_Power, on; ``moving`` catches an axis that moves, instead of waiting for its rest."""

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
    """MC_MoveVelocity; the velocity of ``profile`` is signed. ``life`` in seconds: MC_Jog, ends unless renewed.

    ``renews``: it lets the jog that runs live on, and begins none where that has ended, by a halt of anybody's.
    """

    profile: MoveProfile
    life: float | None = None
    renews: bool = False


@dataclass(frozen=True, slots=True)
class TorqueControl:
    """MC_TorqueControl: ``torque`` in 0.1 % of rated torque, ``slope`` in 0.1 %/s (None: as the drive has it)."""

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
    """A loop of the program's own: it answers each cycle by an ``ControllerOutput`` with a velocity in csv or a torque in cst.

    ``by`` has the ramps to what is answered. ``number`` tells this loop from others; an answer may be of the values
    that are ``late`` cycles (from 0 on) older than those of the cycle before.
    """

    number: int
    by: CyclicVelocity | CyclicTorque
    late: int = 0


@dataclass(frozen=True, slots=True)
class ControllerOutput:
    """What the loop of ``ControllerCommand`` ``number`` answers to the values of the cycle at ``cycle`` (s, monotonic).

    ``value`` as in ``CyclicVelocity`` or ``CyclicTorque``; a ``failure`` instead is why it will not answer any more.
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
    """MC_SetPosition: the actual position is called ``position`` (increments) from now on."""

    position: int


@dataclass(frozen=True, slots=True)
class FollowTrajectory:
    """A trajectory in cyclic synchronous position mode."""

    trajectory: Trajectory


@dataclass(frozen=True, slots=True)
class Buffered:
    """``command`` begins when the one before it has ended well (PLCopen's buffer mode *Buffered*)."""

    command: Move | MoveVelocity


@dataclass(frozen=True, slots=True)
class BufferedMove:
    """``move`` takes over from the one before it without a stop, at the velocity that ``mode`` says (PLCopen's BufferMode).

    ``direction``: to a place of an endless axis, from the end of the one before: 0 shortest way, 1 positive, -1 negative.
    """

    move: Move
    mode: BufferMode
    direction: int = 0


@dataclass(frozen=True, slots=True)
class GearOut:
    """MC_GearOut, MC_CamOut: an axis that is led by another one goes on by itself, with its present speed."""


@dataclass(frozen=True, slots=True)
class Probe:
    """MC_TouchProbe: tell where the axis is at the next edge of input ``number`` (1 or 2) of each kind, or at every one.

    ``window``: from where to where (in units) an edge counts. ``key`` tells this request from others of its program.
    """

    number: int
    edges: frozenset[Edge]
    source: ProbeSource
    continuous: bool
    window: tuple[float, float] | None
    key: int


@dataclass(frozen=True, slots=True)
class ProbeAbort:
    """MC_AbortTrigger: switch input ``number`` off; with ``key`` only what that request has armed."""

    number: int
    key: int | None = None


@dataclass(frozen=True, slots=True)
class SetOverride:
    """MC_SetOverride: what the axis is led at, or its drive plans, goes at ``factor`` times its velocity, 0 (it holds) to 1.5."""

    factor: float


@dataclass(frozen=True, slots=True)
class SetTorqueOffset:
    """The constant torque of feed-forward (60B2h), in 0.1 % of rated torque."""

    torque: int


@dataclass(frozen=True, slots=True)
class PhaseBy:
    """MC_PhasingRelative: the slave sees its master ``shift`` units farther on, by ``velocity`` and ``acceleration`` at most.

    All in units of the master, per s and per s²; both above 0.
    """

    shift: float
    velocity: float
    acceleration: float


@dataclass(frozen=True, slots=True)
class MoveSuperimposed:
    """MC_MoveSuperimposed: ``distance`` is laid over what leads the axis, in its unit, per s and per s²; all but it above 0."""

    distance: float
    velocity: float
    acceleration: float
    deceleration: float


@dataclass(frozen=True, slots=True)
class HaltSuperimposed:
    """MC_HaltSuperimposed: the addition comes to rest, by ``deceleration`` (unit/s²; None: its own); the path goes on."""

    deceleration: float | None = None


@dataclass(frozen=True, slots=True)
class Shutdown:
    """The stop ladder down to a disabled drive, on the way out of the program; ``quick`` begins with quick stop."""

    reason: str
    quick: bool = False


@dataclass(frozen=True, slots=True)
class PolicyStop:
    """A halt that the fault policy orders because of another axis; ``how`` hard."""

    reason: str
    how: GroupFault = GroupFault.PATH


@dataclass(frozen=True, slots=True)
class HandOver:
    """A halt of what moves, because the command of the machine goes to another program, or who had it is gone or interrupted."""

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
