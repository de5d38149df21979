"""Mutants of the product for the campaign's self-test: each changes one decision of a running process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any, NamedTuple
from unittest.mock import patch

from axisbus.boot import node as booting
from axisbus.bus.pdo.freshness import LinkLag, SyncLag
from axisbus.bus.port import CanPort
from axisbus.cell import parameters as cell_parameters
from axisbus.cell import scale_proposal
from axisbus.cell.quantities import units_of
from axisbus.core.node_stop import NodeStop
from axisbus.errors import LimitError, MotionTimeout, UncommandedMotion
from axisbus.machine import axis as axis_calls
from axisbus.machine.axis import Axis
from axisbus.machine.request import AxisCall
from axisbus.motion.axis import accept_motion
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.axis.reference import DemandTrust
from axisbus.motion.gantry import core as gantry_core
from axisbus.motion.moves import follow
from axisbus.motion.moves.arrival import ArrivalCheck
from axisbus.motion.moves.prepare import RampTransfers
from axisbus.motion.parameters import DemandUse
from axisbus.motion.pathclock import PathClock
from axisbus.motion.position_limits import UNLIMITED
from axisbus.motion.stop import limits, supervision
from axisbus.motion.stop.following_error import FollowingErrorMonitor
from axisbus.motion.stop.limits import LimitMonitor
from axisbus.motion.stop.policy import FaultPolicy
from axisbus.motion.stop.standstill import StandstillCheck
from axisbus.motion.stop.stop_sequence import StopLevel, StopSequence
from axisbus.motion.stop.velocity_following import VelocityRampTracker


class Mutant(NamedTuple):
    """The fault, and the names to replace: the owner, the attribute, and a function from the original to its replacement."""

    what: str
    patches: tuple[tuple[Any, str, Callable[[Any], Any]], ...]


def _shifted(original: Callable[..., int]) -> Callable[..., int]:
    def absolute(self: Axis, *args: Any) -> int:
        top = (self._parameters.limits.velocity or 0.0) * abs(self._parameters.units.position.factor)
        return original(self, *args) + round(0.01 * top)

    return absolute


def _twice_as_strong(
    original: Callable[..., tuple[StopLevel, float | None]],
) -> Callable[..., tuple[StopLevel, float | None]]:
    def stop(*args: Any) -> tuple[StopLevel, float | None]:
        level, ramp = original(*args)
        return level, None if ramp is None else 2.0 * ramp

    return stop


def _by_default(
    original: Callable[..., tuple[StopLevel, float | None]],
) -> Callable[..., tuple[StopLevel, float | None]]:
    def stop(parameters: Any, commanded: Any) -> tuple[StopLevel, float | None]:
        level, ramp = original(parameters, commanded)
        return level, None if ramp is None else parameters.slow_ramp

    return stop


def _done_at_once(original: Callable[..., bool]) -> Callable[..., bool]:
    def step(self: StopSequence, *args: Any) -> bool:
        ended = original(self, *args)
        if self.level is StopLevel.HALT and not self.removes_power:
            self.confirmed = ended = True
        return ended

    return step


def _unanswered(original: Callable[..., bool]) -> Callable[..., bool]:
    def unpowered(self: StopSequence, image: Any, order: Any, coast_down: Any) -> bool:
        original(self, image, order, coast_down)
        self.confirmed = True
        return True

    return unpowered


def _mirrored(original: Callable[..., int]) -> Callable[..., int]:
    return lambda self, velocity: -original(self, velocity)


def _harder(original: Callable[..., None]) -> Callable[..., None]:
    return lambda self, way, deceleration: original(self, way, 1.5 * deceleration)


def _late(original: Callable[..., bool]) -> Callable[..., bool]:
    """A move has not arrived before a second has passed: every shorter one ends by its time-out."""

    def complete(self: ArrivalCheck, activity: Any, done: bool, seen: Any) -> bool:
        if original(self, activity, done, seen):
            raise MotionTimeout("mutant: not there in time")
        return False

    return complete


def _ratio_assumed(_: Any) -> Callable[..., Any]:
    return lambda axis, _values: replace(units_of(axis), ratio_known=True)


def _as_written(_: Any) -> Callable[..., int | None]:
    return lambda self, index, otherwise: self._asked.get(index, otherwise)


def _empty(_: Any) -> Callable[..., tuple[()]]:
    return lambda *_args: ()


def _never_late(_: Any) -> Callable[..., float]:
    return lambda *_args: 0.0


def _zero(_: Any) -> float:
    return 0.0


def _endless_count(_: Any) -> Callable[..., Any]:
    return lambda _position: UNLIMITED


def _believed(_: Any) -> Callable[..., bool]:
    return lambda self, _mode: self._use is not DemandUse.IGNORE


def _astray(original: Callable[..., None]) -> Callable[..., None]:
    """A move that is late counts as one that goes where it should not."""

    def failed(self: AxisCore, error: Any) -> None:
        original(self, UncommandedMotion(error.message) if isinstance(error, MotionTimeout) else error)

    return failed


def _aimed_at_once(_: Any) -> Callable[..., None]:
    def send(self: VelocityRampTracker, _: Any) -> None:
        self._taken = self._target
        self._due.clear()

    return send


def _not_back(original: Callable[..., int]) -> Callable[..., int]:
    """Reject every move that begins beyond a limit."""

    def require(parameters: Any, position: int, ticket: Any, start: Any = None, noise: float = 0.0) -> int:
        if start is not None and original(parameters, round(start), ticket, None, 0.0) != round(start):
            raise LimitError(f"mutant: {ticket.name} begins beyond the position limits")
        return original(parameters, position, ticket)

    return require


def _unchecked(_: Any) -> Callable[..., float]:
    return lambda _, value: value


def _nothing(_: Any) -> Callable[..., None]:
    return lambda *_args, **_more: None


def _true(_: Any) -> Callable[..., bool]:
    return lambda *_args, **_more: True


def _nobody(_: Any) -> Callable[..., frozenset[str]]:
    return lambda *_args: frozenset()


def _silent_after_boot_up(original: Callable[..., None]) -> Callable[..., None]:
    """Nothing is sent any more to a node under whose ID a boot-up frame came."""

    def write(self: CanPort, outputs: Any) -> None:
        if self._restarted_since is None:
            original(self, outputs)
        else:
            self._frames = []

    return write


def _as_received(_: Any) -> Callable[..., float]:
    return lambda self, *_args: self._slot.latest[1]


def _no_allowance(original: Callable[..., Any]) -> Callable[..., Any]:
    def error(self: FollowingErrorMonitor, seen: Any, activity: Any) -> Any:
        with patch.object(type(self._parameters), "lag_allowed", lambda *_args, **_more: 0.0):
            return original(self, seen, activity)

    return error


MUTANTS: Mapping[str, Mutant] = {
    "no-fault-policy": Mutant(
        "the failure of an axis stops no other axis", ((FaultPolicy, "_stops", _nobody),)
    ),
    "shifted-targets": Mutant(
        "absolute targets are off by 10 ms at max_velocity", ((Axis, "_absolute_increments", _shifted),)
    ),
    "weak-brake": Mutant(
        "the look-ahead believes in a brake that is twice as strong",
        ((limits, "stop_of", _twice_as_strong), (supervision, "stop_of", _twice_as_strong)),
    ),
    "default-deceleration": Mutant(
        "the look-ahead reckons with the default deceleration",
        ((limits, "stop_of", _by_default), (supervision, "stop_of", _by_default)),
    ),
    "no-look-ahead": Mutant(
        "position limits are not looked at in motion", ((LimitMonitor, "danger", _nothing),)
    ),
    "early-done": Mutant(
        "a halt is done while the axis still brakes", ((StopSequence, "step", _done_at_once),)
    ),
    "unanswered-word": Mutant(
        "a stop without power is done while a controlword has not taken effect",
        ((StopSequence, "_unpowered", _unanswered),),
    ),
    "rest-assumed": Mutant("every axis counts as standing", ((StandstillCheck, "seen", _true),)),
    "wrong-way": Mutant("velocities have the other sign", ((AxisCall, "_turn", _mirrored),)),
    "no-velocity-limit": Mutant(
        "velocities are not checked at the call", ((AxisCall, "_velocity", _unchecked),)
    ),
    "no-acceleration-limit": Mutant(
        "ramps are not checked at the call", ((AxisCall, "_acceleration", _unchecked),)
    ),
    "hard-brake": Mutant("paths are braked harder than they may be", ((PathClock, "brake", _harder),)),
    "no-allowance": Mutant("no lag is allowed in motion", ((FollowingErrorMonitor, "error", _no_allowance),)),
    "never-there": Mutant(
        "a move that has arrived ends by its time-out", ((ArrivalCheck, "complete", _late),)
    ),
    "ratio-assumed": Mutant(
        "velocities of an axis in increments count as increments per second, whatever the drive counts",
        ((cell_parameters, "known_units", _ratio_assumed), (booting, "known_units", _ratio_assumed)),
    ),
    "ramps-believed": Mutant(
        "a drive has the ramps that were written, also where it did not take them",
        (
            (RampTransfers, "_known", _as_written),
            (cell_parameters, "fixed_ramps", _empty),
            (booting, "fixed_ramps", _empty),
        ),
    ),
    "unit-objects-unread": Mutant(
        "the drive's unit objects are not compared", ((scale_proposal, "contradictions", _empty),)
    ),
    "no-window": Mutant(
        "a position that wanders by some increments at a limit is beyond it",
        tuple((where, "NOISE", _zero) for where in (accept_motion, axis_calls, gantry_core, limits, follow)),
    ),
    "no-way-back": Mutant(
        "an axis beyond a limit may not come back", ((accept_motion, "require_within_limits", _not_back),)
    ),
    "endless-count": Mutant(
        "targets beyond the end of INTEGER32 are given", ((accept_motion, "count_range", _endless_count),)
    ),
    "demand-at-once": Mutant(
        "6062h is trusted before it was seen ahead of the axis", ((DemandTrust, "trusts", _believed),)
    ),
    "state-outlives-power": Mutant(
        "state survives the loss of power and a restart of the count", ((AxisCore, "forget", _nothing),)
    ),
    "late-is-astray": Mutant(
        "a move that is late is answered as one that goes elsewhere",
        ((AxisCore, "_activity_failed", _astray),),
    ),
    "silent-after-boot-up": Mutant(
        "a node under whose ID a boot-up frame came is sent nothing any more, not even a stop",
        ((CanPort, "_write_any", _silent_after_boot_up), (NodeStop, "run", _empty)),
    ),
    "age-by-reception": Mutant(
        "values count as new when they come, however late that is",
        ((SyncLag, "step", _as_received), (LinkLag, "step", _never_late)),
    ),
    "aimed-at-once": Mutant(
        "a drive counts as going to a new velocity from the cycle on in which it was sent, and the difference stays",
        ((VelocityRampTracker, "_send", _aimed_at_once), (VelocityRampTracker, "_settle", _nothing)),
    ),
}


@contextmanager
def mutated(name: str) -> Iterator[None]:
    """Let the product be a mutant meanwhile; with no name it stays as it is."""
    with ExitStack() as stack:
        for where, attribute, make in MUTANTS[name].patches if name else ():
            stack.enter_context(patch.object(where, attribute, make(getattr(where, attribute))))
        yield
