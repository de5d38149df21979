"""Whether the offsets of an axis may act in this cycle, and the set-point that they are computed from."""

from __future__ import annotations

from typing import TYPE_CHECKING

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.motion.cyclic.ramps import VelocityRamp
from axisbus.motion.feed_forward.offsets import Forward, Offsets
from axisbus.motion.moves.enable import EnableActivity
from axisbus.motion.moves.follow import Follow
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.states import AxisState
from axisbus.motion.stop.active_stop import StopKind
from axisbus.motion.stop.stop_sequence import StopLevel

if TYPE_CHECKING:
    from axisbus.motion.axis.core import AxisCore

_ENABLED = PowerState.OPERATION_ENABLED
_CSP, _CSV = int(ModeOfOperation.CYCLIC_SYNC_POSITION), int(ModeOfOperation.CYCLIC_SYNC_VELOCITY)
_MAY_BE_ENERGISED = ENERGISED | {PowerState.UNKNOWN}
# States in which the constant torque acts; in the others the axis is being stopped, or was stopped.
_HELD = frozenset(
    {
        AxisState.STANDSTILL,
        AxisState.DISCRETE_MOTION,
        AxisState.CONTINUOUS_MOTION,
        AxisState.SYNCHRONIZED_MOTION,
    }
)
_LEFT_AS_FOUND: Offsets = (None, None)


def forward_of(parameters: AxisParameters) -> Forward | None:
    """Return the feed-forward of an axis; None if its cell file configures none."""
    given = parameters.feed_forward
    return Forward(given, parameters) if given is not None and given.outputs else None


def offsets_of(core: AxisCore, forward: Forward) -> Offsets:
    """Return the offsets to send with the set-points of this cycle."""
    if not _is_led(core):
        nothing = forward.rest()
        return _LEFT_AS_FOUND if _is_as_found(core) else nothing
    by_position = core.image.mode == _CSP
    return forward.lead(_velocity(core), by_position=by_position, holds=_holds(core))


def _is_as_found(core: AxisCore) -> bool:
    """Return whether to leave the offsets as found: an enabled drive may depend on them until an enable takes it over."""
    if not core.touched:
        return True
    enables = isinstance(core.activity, EnableActivity) and core.ladder is None and not core.powered
    return enables and core.image.state in _MAY_BE_ENERGISED


def _is_led(core: AxisCore) -> bool:
    """Return whether this master has enabled the drive, it adds its offsets to targets in this mode, and it is to stay enabled."""
    image, order, ladder = core.image, core.order, core.ladder
    return (
        core.powered
        and image.state is _ENABLED
        and image.mode in (_CSP, _CSV)
        and order.goal is _ENABLED
        and order.word is None
        and (ladder is None or ladder.rung is StopLevel.HALT)
    )


def _holds(core: AxisCore) -> bool:
    ladder = core.ladder
    leaves = ladder is not None and (ladder.takes_power or core.stopping.kind is StopKind.SHUTDOWN)
    return core.state in _HELD and not leaves


def _velocity(core: AxisCore) -> float | None:
    """Return the velocity of the set-point of this cycle, in unit/s; None if there is none."""
    order, ladder, activity = core.order, core.ladder, core.activity
    leading = ladder.follow if ladder is not None else None if activity is None else activity.leading
    if isinstance(leading, Follow):
        leads = core.image.mode == _CSP and order.target_position is not None and leading.is_under_way
        return leading.last_step.velocity if leads else None
    if isinstance(leading, VelocityRamp) and core.image.mode == _CSV and order.target_velocity is not None:
        return core.parameters.units.velocity.to_units(leading.velocity)
    return None
