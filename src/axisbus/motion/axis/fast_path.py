"""Do the whole cycle of an axis that continues along its trajectory, with no news but its position and its next target.

Theory of operation
-------------------
Nearly every cycle of a trajectory is of this kind, and there is one for each axis. In such a cycle the whole step
(``AxisCore.step``) asks two dozen objects that have nothing to report, and after a sleep of the scan each of them must be loaded
from slow memory. So one function makes all checks here. First it checks everything without changing anything; if any check finds
something unusual, the whole step does the cycle. Then it stores the remaining values, as the whole step stores them.

A ``FastPath`` is made at the end of a whole step (``fast_path_of``), and ends with the next one. Conditions that only a whole step
changes are checked then. Conditions that commands, groups and the scan may change between two cycles are checked in every cycle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from axisbus.cia402.port import Inputs, Outputs
from axisbus.cia402.state import PowerState, decode
from axisbus.motion.axis.cycle_outputs import ENABLE_OPERATION_WORD
from axisbus.motion.moves.follow import Follow
from axisbus.motion.states import AxisState
from axisbus.units import INT32_HALF, INT32_LEAST

if TYPE_CHECKING:
    from axisbus.motion.axis.core import AxisCore

_ENABLED, _SYNCHRONIZED = PowerState.OPERATION_ENABLED, AxisState.SYNCHRONIZED_MOTION
_CSP = int(Follow.mode)
_HALF = float(INT32_HALF)
_tuple = tuple.__new__  # makes a named tuple of values known to fit, without the call of its own ``__new__``


class FastPath:
    """Holds the objects that the cycles of one axis need, close together, and the NMT state that must not change."""

    __slots__ = (
        "_core",
        "_demand_track",
        "_fastest",
        "_follow",
        "_following",
        "_forward",
        "_image",
        "_modes_age",
        "_nmt",
        "_order",
        "_period",
        "_positions_age",
        "_reference_tracker",
        "_running",
        "_standstill_waiters",
        "_stopping",
        "_track",
        "_window",
        "_words_age",
    )

    def __init__(self, core: AxisCore, follow: Follow) -> None:
        image, supervision = core.image, core.supervision
        self._core, self._image, self._follow = core, image, follow
        self._order, self._running, self._stopping = core.order, core.running, core.stopping
        self._reference_tracker, self._following = image.reference_tracker, supervision.following
        self._standstill_waiters = core.standstill_waiters
        self._forward = core.forward
        self._track, self._demand_track = supervision.guard.tracks
        self._period, self._window = core.parameters.scan_period, core.parameters.pull_window
        self._words_age, self._modes_age, self._positions_age = image.max_age[:3]
        self._fastest = image.fastest
        self._nmt = image.nmt

    def step(self, inputs: Inputs) -> Outputs | None:
        """Do the work of ``AxisCore.step`` in such a cycle and return its outputs; in any other cycle do nothing, return None."""
        (
            now,
            operational,
            word,
            mode,
            position,
            velocity,
            torque,
            demand,
            emcy,
            sdo,
            nmt,
            bus,
            overdue,
            _,
            twice,
            _,
        ) = inputs
        if (
            not operational  # a restarted node is not operational
            or emcy
            or sdo
            or nmt != self._nmt
            or bus is not None
            or overdue
            or twice
            or word is None
            or mode is None
            or position is None
        ):
            return None
        core, image = self._core, self._image
        if (
            core.state is not _SYNCHRONIZED
            or not core.may_use_fast_path()
            or self._running.activity is not self._follow
            or self._running.set_point is not None
            or self._stopping.stop_sequence is not None
            or self._standstill_waiters.waiting
            or not self._order.is_clear()
        ):
            return None
        # The values must be fresh, the drive still enabled and in its mode, and the axis near its commanded position.
        late = now - image.now - self._period
        since = now - late if late > 0.0 else now
        raw, came = position
        target, window = self._reference_tracker.target, self._window
        if (
            late >= self._period
            or (word.value != image.statusword and decode(word.value) is not _ENABLED)
            or word.stamp < since - self._words_age
            or mode.value != _CSP
            or mode.stamp < since - self._modes_age
            or not since - self._positions_age <= came <= now
            or came < image.position_stamp
            or (came - image.position_stamp) * self._fastest >= _HALF
            or not INT32_LEAST <= raw - image.last_position < INT32_HALF
            or target is None
            or not -window <= target - raw <= window
            or now <= self._following.commanded_at
        ):
            return None
        ages = image.max_age
        if velocity is not None and velocity.stamp < since - ages[3]:
            return None
        if torque is not None and torque.stamp < since - ages[4]:
            return None
        if demand is None:
            if image.had_demand:
                return None
        elif not -window <= demand.value - raw <= window:
            return None
        ahead = self._follow.foresee()
        if ahead is None:
            return None
        # Nothing is unusual.
        image.update_unchanged(now, word, mode, position)
        if velocity is None:
            image.velocity = None
        else:
            image.velocity, image.velocity_stamp = velocity
        image.torque = None if torque is None else torque.value
        if demand is not None:
            image.take_demand(demand, since - ages[5])
        self._track.take(raw, came)
        if self._demand_track is not None:
            self._demand_track.take(image.demand, image.demand_stamp)
        self._following.close(target, now)
        before, reference_tracker = target, self._reference_tracker
        reference_tracker.target = core.last_target = target = self._follow.use_foreseen(ahead, now)
        reference_tracker.rate = target - before
        if self._forward is not None:
            offsets = self._forward.offsets(ahead[1])
            return _tuple(
                Outputs, (ENABLE_OPERATION_WORD, None, target, None, None, (), (), False, *offsets, None)
            )
        return _tuple(
            Outputs, (ENABLE_OPERATION_WORD, None, target, None, None, (), (), False, None, None, None)
        )


def fast_path_of(core: AxisCore) -> FastPath | None:
    """Return the fast path of an axis after an uneventful whole step; None if the next cycle may require more."""
    follow, image = core.running.activity, core.image
    if (
        not isinstance(follow, Follow)
        or not follow.foresees
        or image.state is not _ENABLED
        or image.position is None
    ):
        return None
    quiet = image.bus is None and not (image.replies or image.emcy or image.overdue)
    usual = (
        quiet
        and image.flight.word == ENABLE_OPERATION_WORD
        and image.reference_tracker.only_target_would_change(image.mode)
    )
    return FastPath(core, follow) if usual and core.supervision.only_follows(follow) else None
