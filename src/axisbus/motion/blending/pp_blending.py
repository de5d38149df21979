"""Ends of moves that a drive passes in profile position mode: when it is to be given the next velocity, and who has been passed.

Theory of operation
-------------------
CiA 402 has bit 9 (change on set-point) with a buffer of set-points for that. It is not used: how many set-points a drive keeps, and
which of the profile it keeps with them, differs; it knows *previous* alone of PLCopen's four velocities; and what a drive keeps in
its buffer is gone on with when a halt ends. So the drive has one set-point, the last end of all, which it takes at once (bit 5). It
passes the ends before that with the velocity that it has, and where this is to be another one, it is given anew.

*When*: at the end itself where the velocity of the one before is kept until there, else as much before as the change takes by the
ramps of the next. The writes and the handshake take time as well: as long as they took the last time. One that comes too early
keeps to the velocity of the next a little longer; one that comes too late passes the end a little faster, or slower. Nothing jumps:
each change is made by the drive's own ramps.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from axisbus.motion.axis.image import AxisImage
from axisbus.motion.blending.command_ends import CommandEnds
from axisbus.motion.blending.mode import BufferMode
from axisbus.motion.blending.notes import brakes_harder, passed_slower
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.moves.activity import present_speed
from axisbus.motion.moves.profile import MoveProfile, braking_distance
from axisbus.motion.parameters import AxisParameters

_LEAD = 0.25  # seconds: what a hold has delayed is no measure
_LATE = 5.0  # scan periods beside that, in which the axis goes on as it was
_SLOWER = 0.85  # of the velocity that was asked for: the measured one is noisy


class BlendedTarget(NamedTuple):
    """A move: where it ends (unwrapped increments), its profile, how it takes over, and its ticket."""

    target: int
    profile: MoveProfile
    mode: BufferMode
    ticket: CommandStatus


class PpBlending:
    """Holds the moves whose ends are ahead, and whether the drive has been asked for the velocity of the second."""

    __slots__ = (
        "_asked_at",
        "_is_asked",
        "_lead",
        "_milestones",
        "_number",
        "_parameters",
        "_parts",
    )

    def __init__(self, first: BlendedTarget, parameters: AxisParameters) -> None:
        """``first``: the move that is under way."""
        self._parts = deque([first])
        self._parameters = parameters
        self._milestones = CommandEnds()
        self._number = 0
        self._is_asked = False
        self._asked_at: float | None = None
        self._lead = 0.0

    @property
    def commands(self) -> int:
        """How many moves share the motion, and have not ended."""
        return len(self._parts)

    def add(self, part: BlendedTarget, now: float) -> None:
        """Go on to the end of another move, of which the drive is given the target at once."""
        before = self._parts[-1].ticket
        self._milestones.add(before, part.ticket)
        self._milestones.mark(before, self._number)
        self._number += 1
        self._parts.append(part)
        self._asked_at = now

    def taken(self, now: float) -> None:
        """The drive has taken what it was given last: it is known how long that takes."""
        if self._asked_at is not None:
            self._lead, self._asked_at = min(now - self._asked_at, _LEAD), None

    def look(self, image: AxisImage) -> MoveProfile | None:
        """Return the profile that the drive is to have from now on; None where it keeps the one that it has."""
        if image.position is None or len(self._parts) < 2:
            return None
        before, after = self._parts[0], self._parts[1]
        ahead = math.copysign(1.0, after.target - before.target) * (before.target - image.position)
        asked = None
        if not self._is_asked and ahead <= self._distance(before, after, image.override):
            self._is_asked = True
            if not _is_same(before.profile, after.profile):
                asked, self._asked_at = self._braking(before.profile, after.profile, image), image.now
                if asked is not after.profile:
                    after.ticket.note = brakes_harder()
        if ahead <= 0:
            self._pass(before, after, image)
        return asked

    def _distance(self, before: BlendedTarget, after: BlendedTarget, factor: float) -> float:
        """Return how far before the end of a move the drive must be given the velocity of the next."""
        old, new, up, down = before.profile.speed, after.profile.speed, after.profile.up, after.profile.down
        assert old
        assert new
        assert up
        assert down
        old, new = old * factor, new * factor
        if after.mode.velocity(old, new) == old:
            return 0.0
        return abs(new * new - old * old) / (2.0 * (up if new > old else down)) + old * self._lead

    def _braking(self, before: MoveProfile, after: MoveProfile, image: AxisImage) -> MoveProfile:
        """Return the profile of the second, with the deceleration of the first where its own comes too late for the last end.

        That is all that the drive brakes for: it was planned with the first until now.
        """
        position, speed = image.position, (before.speed or 0.0) * image.override
        assert position is not None
        assert before.down
        assert after.down
        speed = max(speed, present_speed(image, self._parameters))
        left = abs(self._parts[-1].target - position) - speed * (
            self._lead + _LATE * self._parameters.scan_period
        )
        if after.down >= before.down or braking_distance(speed, after.down) <= left:
            return after
        ramp = min(after.up or before.down, before.down)
        return after._replace(deceleration=before.deceleration, down=before.down, ramp=ramp)

    def _pass(self, before: BlendedTarget, after: BlendedTarget, image: AxisImage) -> None:
        self._parts.popleft()
        self._is_asked = False
        self._tell(before, after, image)
        self._milestones.pass_to(self._number - len(self._parts))

    def _tell(self, before: BlendedTarget, after: BlendedTarget, image: AxisImage) -> None:
        """Note on the second where it has taken over at a lower velocity than it was to."""
        speed, factor = present_speed(image, self._parameters), image.override
        assert before.profile.speed
        assert after.profile.speed
        asked = after.mode.velocity(before.profile.speed, after.profile.speed) * factor
        if 0.0 < speed < _SLOWER * asked:
            units = self._parameters.units.position
            unit = abs(units.factor)
            told = passed_slower(speed / unit, asked / unit, units.unit)
            after.ticket.note = "; ".join(filter(None, (told, after.ticket.note)))


def _is_same(one: MoveProfile, other: MoveProfile) -> bool:
    """Whether a drive need not be told of the second; a caller's time for it has to begin anew."""
    return one[:3] == other[:3] and one.timeout is None and other.timeout is None
