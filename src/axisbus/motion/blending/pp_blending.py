"""Blended moves in profile position mode: when to write the next velocity, and which commands have ended.

Theory of operation
-------------------
CiA 402 defines bit 9 (change on set-point) and a set-point buffer for this purpose. They are not used, for three reasons. Drives
differ in the number of buffered set-points and in the profile parameters stored with them. Bit 9 supports only *previous* of
PLCopen's four velocities. After a halt a drive continues with its buffered set-points. So the drive gets one set-point, the end of
the last command, which it takes at once (bit 5). It passes the earlier ends at its velocity, and if this velocity is to change, the
set-point is written again.

*When*: at the end of a command if its velocity applies up to there; otherwise earlier, by the distance of the speed change at the
ramps of the next command. The writes and the handshake take time as well: their last measured duration is used. If a change comes
too early, the axis runs at the next velocity a little longer; if it comes too late, the axis passes the end a little faster or
slower. Nothing jumps, because the drive's own ramps make each change.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from axisbus.cia402.objects import PROFILE_DECELERATION
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.blending.mode import BufferMode, brakes_harder, passed_slower
from axisbus.motion.command_status import CommandEnds, CommandStatus
from axisbus.motion.moves.activity import present_speed
from axisbus.motion.moves.profile import MoveProfile, braking_distance
from axisbus.motion.parameters import AxisParameters

_MAX_RESPONSE_TIME = 0.25  # seconds: a longer response was delayed by a hold and is not representative
_REACTION_CYCLES = 5.0  # additional scan periods during which the axis continues unchanged
_SPEED_SHARE = 0.85  # of the requested velocity: the measured one is noisy


class BlendedTarget(NamedTuple):
    """A move: its end (unwrapped increments), its profile, how it takes over, and its ticket."""

    target: int
    profile: MoveProfile
    mode: BufferMode
    ticket: CommandStatus


class PpBlending:
    """Holds the moves whose ends are ahead, and whether the velocity of the second has been written to the drive."""

    __slots__ = (
        "_ends",
        "_is_requested",
        "_number",
        "_parameters",
        "_parts",
        "_requested_at",
        "_response_time",
    )

    def __init__(self, first: BlendedTarget, parameters: AxisParameters) -> None:
        """``first``: the active move."""
        self._parts = deque([first])
        self._parameters = parameters
        self._ends = CommandEnds()
        self._number = 0
        self._is_requested = False
        self._requested_at: float | None = None
        self._response_time = 0.0

    @property
    def commands(self) -> int:
        """The number of moves that share the motion and have not ended."""
        return len(self._parts)

    def add(self, part: BlendedTarget, now: float) -> None:
        """Append another move, whose target is written to the drive at once."""
        before = self._parts[-1].ticket
        self._ends.add(before, part.ticket)
        self._ends.mark(before, self._number)
        self._number += 1
        self._parts.append(part)
        self._requested_at = now

    def taken(self, now: float) -> None:
        """Note that the drive has accepted the last set-point, to measure the response time."""
        if self._requested_at is not None:
            self._response_time, self._requested_at = min(now - self._requested_at, _MAX_RESPONSE_TIME), None

    def look(self, image: AxisImage) -> MoveProfile | None:
        """Return the profile to write to the drive now; None if the drive keeps its profile."""
        if image.position is None or len(self._parts) < 2:
            return None
        before, after = self._parts[0], self._parts[1]
        ahead = math.copysign(1.0, after.target - before.target) * (before.target - image.position)
        requested = None
        if not self._is_requested and ahead <= self._distance(before, after, image.override):
            self._is_requested = True
            if not _is_same(before.profile, after.profile):
                requested, self._requested_at = self._braking(before.profile, after.profile, image), image.now
                if requested is not after.profile:
                    after.ticket.note = brakes_harder()
                    self._parts[1] = after._replace(
                        profile=requested
                    )  # the drive has it when the next end comes
        if ahead <= 0:
            self._pass(before, after, image)
        return requested

    def _distance(self, before: BlendedTarget, after: BlendedTarget, factor: float) -> float:
        """Return the distance before the end of a move at which the next velocity must be written."""
        old, new, up, down = before.profile.speed, after.profile.speed, after.profile.up, after.profile.down
        assert old
        assert new
        assert up
        assert down
        old, new = old * factor, new * factor
        if after.mode.velocity(old, new) == old:
            return 0.0
        return abs(new * new - old * old) / (2.0 * (up if new > old else down)) + old * self._response_time

    def _braking(self, before: MoveProfile, after: MoveProfile, image: AxisImage) -> MoveProfile:
        """Return the second profile, with the first one's deceleration if its own is too low to stop at the last end.

        The drive brakes only for the last end, which was planned with the first deceleration until now. A drive without 6084h
        brakes with its acceleration (6083h), so it keeps this as well.
        """
        position, speed = image.position, (before.speed or 0.0) * image.override
        assert position is not None
        assert before.down
        assert after.down
        speed = max(speed, present_speed(image, self._parameters))
        remaining = abs(self._parts[-1].target - position) - speed * (
            self._response_time + _REACTION_CYCLES * self._parameters.scan_period
        )
        if after.down >= before.down or braking_distance(speed, after.down) <= remaining:
            return after
        if not self._parameters.has(PROFILE_DECELERATION):
            after = after._replace(acceleration=before.acceleration, up=before.up)
        ramp = min(after.up or before.down, before.down)
        return after._replace(deceleration=before.deceleration, down=before.down, ramp=ramp)

    def _pass(self, before: BlendedTarget, after: BlendedTarget, image: AxisImage) -> None:
        self._parts.popleft()
        self._is_requested = False
        self._note_lower_speed(before, after, image)
        self._ends.end_passed(self._number - len(self._parts))

    def _note_lower_speed(self, before: BlendedTarget, after: BlendedTarget, image: AxisImage) -> None:
        """Note on the second move if it has taken over at a lower velocity than requested."""
        speed, factor = present_speed(image, self._parameters), image.override
        assert before.profile.speed
        assert after.profile.speed
        requested = after.mode.velocity(before.profile.speed, after.profile.speed) * factor
        if 0.0 < speed < _SPEED_SHARE * requested:
            units = self._parameters.units.position
            unit = abs(units.factor)
            note = passed_slower(speed / unit, requested / unit, units.unit)
            after.ticket.note = "; ".join(filter(None, (note, after.ticket.note)))


def _is_same(one: MoveProfile, other: MoveProfile) -> bool:
    """Return whether no new set-point is needed; one is needed if a timeout given by the caller must restart."""
    return one[:3] == other[:3] and one.timeout is None and other.timeout is None
