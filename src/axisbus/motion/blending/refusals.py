"""Why a motion of a group cannot go on with what is under way, and what would be needed for it."""

from __future__ import annotations

from axisbus.errors import StateError
from axisbus.motion.blending.append_path import PathContinuation
from axisbus.motion.group.path_motion import MOST, PathMotion
from axisbus.wording import counted

COMMANDS = 100  # that share one motion


def no_path_to_extend(name: str) -> StateError:
    """Return why points cannot be added."""
    return StateError(
        f"{name}: the group is on no path to which points could be added",
        observed="its last path has ended, or something else is under way",
        remedy="begin a new one from where the axes stand: group.move_path(points, velocity=..., blend=...)",
    )


def not_a_line(name: str) -> StateError:
    """Return why nothing can be passed into what was asked for."""
    return StateError(
        f"{name}: what the group does cannot be passed into the next without a stop",
        observed="blending goes on from a line or a path of the same axes, behind which nothing waits",
        remedy='let it begin from rest, with buffer="buffered", or wait for what is before it',
    )


def require_joint(line: PathMotion, following: PathContinuation, name: str) -> None:
    """Raise StateError where ``following`` cannot go on from the end of ``line``, or too much is ahead."""
    if line.commands >= COMMANDS or line.pieces + len(following.way.pieces) > MOST:
        raise StateError(
            f"{name}: too much is ahead of the axes already",
            observed=f"{counted(line.commands, 'command')}, pieces of the way: {line.pieces}; allowed are {COMMANDS} and {MOST}",
            remedy="wait for some of the handles before giving more",
        )
    why = line.why_not(following)
    if why:
        raise StateError(
            f"{name}: what the group does cannot be passed into the next without a stop",
            observed=why,
            remedy='let it begin from rest, with buffer="buffered"',
        )
